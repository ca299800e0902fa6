import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.slave.integrators.problems import UP, corner, wall
from weberlink.geometry.vector import ZERO, Vector, add, scale, subtract, unit
from weberlink.slave.integrators.contact_force import ContactResistance, contact_force, pressing
from weberlink.slave.scenes.contact import FrictionCone
from weberlink.slave.scenes.scene import Scene

STEP, INERTIA = 1e-3, 0.2
SIDE: Vector = unit((1.0, 0.2, 0.5))


def implicit(scene: Scene, start: Vector, velocity: Vector) -> Vector:
    """inertia v - h f(start + h v, v): its derivative is what a `ContactResistance` inverts."""
    state = scene.state
    touches = scene.touch(add(start, scale(velocity, STEP)))
    scene.restore(state)
    return subtract(scale(velocity, INERTIA), scale(contact_force(touches, velocity), STEP))


@pytest.mark.parametrize(
    "scene",
    [
        wall(1e5, 30.0, FrictionCone(2.0, 2.0)),
        corner((UP, 1e5, 3.0), (SIDE, 2e4, None), (unit((0.0, 1.0, 0.3)), 5e3, 1.0)),
    ],
    ids=["rough wall", "three planes"],
)
@given(push=st.tuples(*[st.floats(-1.0, 1.0)] * 3))
def test_it_inverts_the_derivative_of_the_implicit_equation(scene: Scene, push: Vector) -> None:
    scene.reset()
    scene.touch((0.0, 0.0, 0.001))
    start: Vector = (-0.004, -0.005, -0.003)
    scene.touch(start)
    velocity: Vector = (0.01, -0.01, -0.02)
    state = scene.state
    at = ContactResistance(scene.touch(add(start, scale(velocity, STEP))), velocity, INERTIA, STEP)
    scene.restore(state)
    change = at.solved(scale(push, 1e-4))
    rise = subtract(implicit(scene, start, add(velocity, change)), implicit(scene, start, velocity))
    assert rise == pytest.approx(scale(push, 1e-4), abs=1e-9)


def test_contact_that_would_pull_has_no_force() -> None:
    scene, leaving = wall(1e5, 30.0), (0.0, 0.0, 0.1)
    scene.touch((0.0, 0.0, 0.001))
    touches = scene.touch((0.0, 0.0, -1e-5))
    assert contact_force(touches, leaving) == ZERO
    assert (pressing(touches, leaving), pressing(touches, ZERO)) == (frozenset(), {0})
