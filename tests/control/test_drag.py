"""Drag takes energy, in bounds, and never throws a light hand back and forth."""

from math import isfinite

from hypothesis import given
from hypothesis import strategies as st

from tests.control.vectors import dot, forces, norm, steps, subtract, vectors
from tests.examples import examples
from weberlink.control.energy import STRONGEST, LevelDrag
from weberlink.control.force_port import LEAST_STEP, ForcePort
from weberlink.geometry.vector import ZERO, Vector

LEVEL = 0.05
TICK = 1e-3
tanks = st.floats(-1.0, 1.0)
mobilities = st.floats(1e-9, 1e-2)


@given(force=forces, way=steps, elapsed=st.floats(0.0, 0.1), tank=tanks, mobility=mobilities)
def test_drag_goes_against_the_way_and_is_bounded(
    force: Vector, way: Vector, elapsed: float, tank: float, mobility: float
) -> None:
    drag = subtract(LevelDrag(5.0, LEVEL).added(force, way, elapsed, tank, mobility), force)
    assert dot(drag, way) <= 1e-12
    assert norm(drag) <= STRONGEST + 1e-9


@given(force=forces, way=steps, tank=st.floats(LEVEL, 1.0))
def test_a_full_tank_drags_nothing(force: Vector, way: Vector, tank: float) -> None:
    assert LevelDrag(5.0, LEVEL).added(force, way, TICK, tank, 1e-5) == force


@given(way=steps, tank=st.floats(0.0, LEVEL), less=st.floats(0.0, LEVEL))
def test_the_fuller_the_tank_the_weaker_the_drag(way: Vector, tank: float, less: float) -> None:
    drag = LevelDrag(5.0, LEVEL)
    fuller, emptier = (norm(drag.added(ZERO, way, TICK, level, 1e-5)) for level in (tank, tank - less))
    assert fuller <= emptier + 1e-12


@given(
    force=vectors(1e30),
    way=vectors(1e30),
    elapsed=st.floats(0.0, 1e3),
    tank=st.floats(-1e30, 1e30),
    mobility=st.floats(1e-30, 1e30),
)
def test_nothing_finite_makes_it_raise_or_infinite(
    force: Vector, way: Vector, elapsed: float, tank: float, mobility: float
) -> None:
    assert all(map(isfinite, LevelDrag(5.0, LEVEL).added(force, way, elapsed, tank, mobility)))


@given(mass=st.floats(0.001, 0.1), speed=st.floats(0.001, 0.5), damping=st.floats(1.0, 100.0))
@examples(40)
def test_a_free_mass_comes_to_rest_and_gains_no_speed(mass: float, speed: float, damping: float) -> None:
    """From 1 g on, or slow: a drag of less than `LEAST_STEP` does not show how light a hand is. The first tick does."""
    drag, port = LevelDrag(damping, LEVEL), ForcePort(TICK, LEVEL)
    at, start, swing = 0.0, speed, STRONGEST * TICK / mass
    for _ in range(600):
        port.move((at, 0.0, 0.0))
        (force, _, _) = drag.added(ZERO, port.way, TICK, 0.0, port.mobility)
        port.hold((force, 0.0, 0.0))
        at += speed * TICK + 0.5 * force / mass * TICK * TICK
        speed += force / mass * TICK
        assert abs(speed) <= max(start, swing)
    assert abs(speed) <= max(0.02 * start, LEAST_STEP / damping)
