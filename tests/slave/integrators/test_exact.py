"""`exact` against solutions that share nothing with it, at any step: flat contact, and one rough plane."""

from math import log10, pi, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.slave.integrators.problems import UP, difference, moving, run, wall
from weberlink.geometry.vector import ZERO, Vector, dot, norm, unit
from weberlink.slave.integrators import INTEGRATORS, ControlledMass
from weberlink.slave.scenes.contact import SceneObject
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.solids import PlaneShape

STEEL = 1e7


def tenfold(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(log10(low), log10(high)).map(lambda exponent: 10.0**exponent)


@examples(40)
@given(
    mass=tenfold(1e-3, 10.0),
    stiffness=tenfold(10.0, STEEL),
    damping=st.one_of(st.none(), tenfold(0.1, 1000.0)),
    control=st.one_of(st.just(0.0), tenfold(10.0, 1e5)),
    ratio=st.sampled_from([0.0, 0.05, 1.0, 5.0]),
    step=tenfold(1e-6, 0.1),
    height=st.floats(-1e-4, 1e-3),
    velocity=st.tuples(*[st.floats(-0.5, 0.5)] * 3),
)
def test_one_step_goes_as_far_as_two_hundred(
    mass: float,
    stiffness: float,
    damping: float | None,
    control: float,
    ratio: float,
    step: float,
    height: float,
    velocity: Vector,
) -> None:
    body = ControlledMass(mass, control, 2.0 * ratio * sqrt(control * mass))
    start, goal = (0.0, 0.0, height), (0.01, 0.0, -0.002)
    once = run("exact", body, lambda: wall(stiffness, damping), start, velocity, goal, step, 1)
    often = run("exact", body, lambda: wall(stiffness, damping), start, velocity, goal, step, 200)
    omega = sqrt((stiffness + control) / mass)
    size = norm(velocity) / omega + abs(height) + 1e-4
    # Each swing of the contact may double the rounding of where it began.
    assert difference(once, often, 0.0) < 1e-9 * max(size, norm(velocity) * step)
    assert difference(once, often, 1.0 / omega) < 1e-9 * (size + norm(velocity) * step + 0.01)


@examples(60)
@given(tenfold(10.0, STEEL), tenfold(1e-3, 10.0), st.floats(0.01, 2.0), st.tuples(*[st.floats(-1.0, 1.0)] * 3))
def test_a_bounce_gives_back_all_of_the_speed(stiffness: float, mass: float, speed: float, normal: Vector) -> None:
    """Undamped, control off, within a single step: mirrored velocity, and pi / omega spent inside."""
    if dot(normal, normal) < 0.1:
        normal = UP
    n, body = unit(normal), ControlledMass(mass, 0.0, 0.0)
    scene = Scene([SceneObject(PlaneShape(ZERO, n), stiffness)])
    start, velocity = (0.001 * n[0], 0.001 * n[1], 0.001 * n[2]), (-speed * n[0], -speed * n[1], -speed * n[2])
    inside = pi / sqrt(stiffness / mass)
    end = INTEGRATORS["exact"].build(body, scene).advance(moving(scene, start, velocity), ZERO, 0.003 / speed + inside)
    assert end.velocity == pytest.approx((speed * n[0], speed * n[1], speed * n[2]), rel=1e-9, abs=1e-9 * speed)
    assert dot(end.position, n) == pytest.approx(0.002, rel=1e-9)
    assert end.force == ZERO
