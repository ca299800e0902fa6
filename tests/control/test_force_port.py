"""The operator's port: exact work, and a force that is reduced by what the tank lacks and never increased."""

from collections.abc import Callable, Iterable
from math import cos, isfinite, pi, sin
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.control.vectors import forces, positions, steps, vectors
from tests.examples import examples
from weberlink.control.force_port import DEBT, LEAST_MASS, RECOVERY, SHARE_OF_TANK, STEEPEST, ForcePort
from weberlink.geometry.vector import ZERO, Vector, add, distance, dot, norm, scale, subtract

TICK = 1e-3
LEVEL = 0.015
tanks = st.floats(-0.01, 0.03)
histories = st.lists(st.tuples(steps, forces, tanks), max_size=20)


def after(history: list[tuple[Vector, Vector, float]]) -> tuple[ForcePort, Vector]:
    """A port after these steps, each with the allowed part of a force; returns it with the force that it holds."""
    port, at, held = ForcePort(TICK, LEVEL), ZERO, ZERO
    for step, force, tank in history:
        at = add(at, step)
        port.move(at)
        held = port.passive(force, tank, TICK)
        port.hold(held)
    return port, held


@given(st.lists(st.tuples(positions, forces), max_size=40))
def test_work_is_that_of_the_held_force_over_the_way(ticks: list[tuple[Vector, Vector]]) -> None:
    port = ForcePort(TICK, LEVEL)
    booked = expected = 0.0
    before, held = None, ZERO
    for position, force in ticks:
        booked += port.move(position)
        if before is not None:
            expected -= dot(held, subtract(position, before))
        port.hold(force)
        before, held = position, force
    assert booked == pytest.approx(expected, abs=1e-12)


@given(history=histories, force=forces, tank=tanks, elapsed=st.floats(0.0, 0.1))
def test_a_force_keeps_its_direction_and_never_grows(
    history: list[tuple[Vector, Vector, float]], force: Vector, tank: float, elapsed: float
) -> None:
    port, _ = after(history)
    passed = port.passive(force, tank, elapsed)
    assert norm(passed) <= norm(force) * (1.0 + 1e-12)
    assert dot(passed, force) == pytest.approx(norm(passed) * norm(force), rel=1e-9, abs=1e-12)


@given(history=histories, force=forces, tank=tanks, elapsed=st.floats(0.0, 0.1))
def test_no_more_than_its_share_of_the_tank_leaves_if_the_hand_goes_on_as_it_did(
    history: list[tuple[Vector, Vector, float]], force: Vector, tank: float, elapsed: float
) -> None:
    """And if it yields to a change of force as a hand of `LEAST_MASS` does."""
    port, held = after(history)
    passed = port.passive(force, tank, elapsed)
    heavy = 0.5 * TICK * TICK / LEAST_MASS
    foreseen = dot(passed, port.way) + heavy * max(0.0, dot(passed, subtract(passed, held)))
    assert foreseen <= max(0.0, SHARE_OF_TANK * tank) * (1.0 + 1e-9) + 1e-15


@given(history=histories, force=forces, elapsed=st.floats(0.0, 0.01))
def test_a_force_rises_no_steeper_than_a_ramp(
    history: list[tuple[Vector, Vector, float]], force: Vector, elapsed: float
) -> None:
    port, held = after(history)
    assert norm(port.passive(force, 1.0, elapsed)) <= norm(held) + STEEPEST * elapsed + 1e-9


@given(histories, forces)
def test_with_enough_in_the_tank_the_force_comes_back_whole(
    history: list[tuple[Vector, Vector, float]], force: Vector
) -> None:
    port, _ = after(history)
    port.move(port.position)
    for _ in range(round(6.0 * RECOVERY / TICK)):
        port.move(port.position)
        passed = port.passive(force, 1e3, TICK)
        port.hold(passed)
    assert distance(passed, force) <= 0.01 * 30.0 * 3.0**0.5


@given(force=forces, tank=st.floats(-1.0, 0.0))
def test_an_empty_tank_lets_no_force_push_a_hand_out(force: Vector, tank: float) -> None:
    port = ForcePort(TICK, LEVEL)
    port.move(ZERO)
    port.move(scale(force, 1e-6))
    passed = port.passive(force, tank, TICK)
    assert dot(passed, force) <= 1e-12


def drawn(ways: Iterable[Vector], wanted: Callable[[int, Vector], Vector]) -> tuple[float, float]:
    """Move a hand by these ways against the secured part of a wanted force.

    Args:
        ways: of the hand [m], tick by tick.
        wanted: the force [N] at a tick after a way [m].

    Returns:
        The largest energy drawn so far at any time beyond what was put in [J], and the largest work of one tick [J].
    """
    port, at, held, tank, lowest, tick_worth = ForcePort(TICK, LEVEL), ZERO, ZERO, 0.0, 0.0, 0.0
    port.move(at)
    for tick, way in enumerate(ways):
        at = add(at, way)
        work = port.move(at)
        tick_worth = max(tick_worth, abs(work))
        tank += work
        lowest = min(lowest, tank)
        held = port.secured(wanted(tick, port.way), tank)
        port.hold(held)
    return -lowest, tick_worth


def against(_: int, way: Vector) -> Vector:
    """10 N against the last way, as a drag."""
    return scale(way, -10.0 / max(norm(way), 1e-12))


@given(st.lists(st.tuples(steps, forces), max_size=100))
def test_no_motion_draws_more_than_was_put_in_but_for_the_debt_and_one_tick(ticks: list[tuple[Vector, Vector]]) -> None:
    ways = [way for way, _ in ticks]
    for wanted in (against, lambda tick, _: ticks[tick][1]):
        out, tick_worth = drawn(ways, wanted)
        assert out <= DEBT + tick_worth + 1e-9


@pytest.mark.parametrize("amplitude", [1e-5, 1e-4, 1e-3, 5e-3])
@pytest.mark.parametrize("seed", range(3))
def test_nor_does_a_long_random_walk_or_a_hand_shaken_at_any_rate(amplitude: float, seed: int) -> None:
    random = Random(seed)
    walk = [(random.uniform(-amplitude, amplitude), 0.0, 0.0) for _ in range(5000)]
    flips = [(amplitude if tick % 2 else -amplitude, 0.0, 0.0) for tick in range(5000)]
    rests = [(amplitude * random.choice((-1, 0, 0, 0, 1)), 0.0, 0.0) for _ in range(5000)]
    phase = random.uniform(0.0, pi)
    shaken = [
        [
            (2.0 * amplitude * sin(pi * hz * TICK) * cos(2.0 * pi * hz * TICK * tick + phase), 0.0, 0.0)
            for tick in range(3000)
        ]
        for hz in (30.0, 230.0, 250.0, 270.0, 375.0, 499.0)
    ]
    for ways in (walk, flips, rests, *shaken):
        out, tick_worth = drawn(ways, against)
        assert out <= DEBT + tick_worth + 1e-9


@pytest.mark.parametrize("speed", [0.01, 0.1, 0.5])
def test_a_drag_fills_an_empty_tank_all_the_same(speed: float) -> None:
    """5 N s/m, after a second of shaking at the Nyquist rate too."""

    def drag(_: int, way: Vector) -> Vector:
        return scale(way, -5.0 / TICK)

    shaken = [(speed * TICK if tick % 2 else -speed * TICK, 0.0, 0.0) for tick in range(1000)]
    moved = [(speed * TICK, 0.0, 0.0)] * 1000
    for ways in (moved, shaken + moved):
        port, at, tank = ForcePort(TICK, LEVEL), ZERO, 0.0
        port.move(at)
        for tick, way in enumerate(ways):
            at = add(at, way)
            tank += port.move(at)
            port.hold(port.secured(drag(tick, port.way), tank))
        assert tank >= 0.8 * 5.0 * speed * speed - DEBT


@given(history=histories, force=forces, tank=st.floats(0.05, 1.0))
def test_with_energy_in_the_tank_no_force_is_taken_away_at_the_speeds_of_a_hand(
    history: list[tuple[Vector, Vector, float]], force: Vector, tank: float
) -> None:
    """Below 0.5 m/s, and below 10 N."""
    history = [(scale(step, 0.1), wanted, available) for step, wanted, available in history]
    force = scale(force, min(1.0, 10.0 / max(norm(force), 1e-9)))
    port, _ = after(history)
    assert port.secured(force, tank) == force


@given(
    st.lists(st.tuples(vectors(1e30), vectors(1e30), st.floats(-1e30, 1e30), st.floats(0.0, 1e3)), max_size=10),
)
def test_nothing_finite_makes_it_raise_or_infinite(ticks: list[tuple[Vector, Vector, float, float]]) -> None:
    port = ForcePort(TICK, LEVEL)
    for position, force, tank, elapsed in ticks:
        assert isfinite(port.move(position))
        passed = port.secured(port.passive(force, tank, elapsed), tank)
        assert all(map(isfinite, passed))
        port.hold(passed)
    assert isfinite(port.mobility)


@given(mass=st.floats(0.001, 0.04))
@examples(20)
def test_a_light_device_is_learned_from_what_a_change_of_force_does_to_it(mass: float) -> None:
    """A free mass moves T^2 / 2m per newton of change in the tick of the change."""
    port, at, speed = ForcePort(TICK, LEVEL), 0.0, 0.0
    for tick in range(10):
        port.move((at, 0.0, 0.0))
        force = float(tick % 2)
        port.hold((force, 0.0, 0.0))
        at += speed * TICK + 0.5 * force / mass * TICK * TICK
        speed += force / mass * TICK
    assert port.mobility == pytest.approx(0.5 * TICK * TICK / mass, rel=0.03)


@pytest.mark.parametrize("jump", [0.001, 0.01, 0.1])
def test_one_wrong_sample_does_not_take_the_force_away_for_good(jump: float) -> None:
    """A hand at rest under 5 N, and one wrong reading at a change of force."""
    port, wanted = ForcePort(TICK, LEVEL), (0.0, 0.0, 5.0)
    for tick in range(2000):
        port.move((0.0, 0.0, jump if tick == 10 else 0.0))
        passed = port.passive(wanted, 0.015, TICK)
        port.hold(passed)
    assert norm(passed) >= 4.9


def test_reset_forgets() -> None:
    port, _ = after([((0.001, 0.0, 0.0), (float(i), 0.0, 0.0), 1.0) for i in range(10)])
    port.reset()
    fresh = ForcePort(TICK, LEVEL)
    for one in (port, fresh):
        assert one.move((5.0, 0.0, 0.0)) == 0.0
    assert port.way == fresh.way == ZERO
    assert port.mobility == fresh.mobility
    assert port.passive((1.0, 2.0, 3.0), 0.01, TICK) == fresh.passive((1.0, 2.0, 3.0), 0.01, TICK)
