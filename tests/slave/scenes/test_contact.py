from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.slave.scenes.solids import GROUND
from weberlink.geometry.vector import Vector, dot, norm, subtract
from weberlink.slave.scenes.contact import FrictionCone, SceneObject
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.solids import SphereShape

TICK = 0.001
STIFFNESS = 1000.0
DEPTH = 0.004
STATIC, DYNAMIC = 0.5, 0.4


def pressed() -> Scene:
    """On the ground at the origin, under 4 N."""
    scene = Scene([SceneObject(GROUND, STIFFNESS, FrictionCone(static=STATIC, dynamic=DYNAMIC))])
    scene.force((0.0, 0.0, 0.001), TICK)
    scene.force((0.0, 0.0, -DEPTH), TICK)
    return scene


@given(share=st.floats(0.0, 0.999), angle=st.floats(-pi, pi))
def test_within_the_static_cone_it_sticks(share: float, angle: float) -> None:
    scene = pressed()
    x = STATIC * DEPTH * share
    assert scene.force((x, 0.0, -DEPTH), TICK) == pytest.approx((-STIFFNESS * x, 0.0, STIFFNESS * DEPTH))
    assert scene.force((0.0, 0.0, -DEPTH), TICK) == pytest.approx((0.0, 0.0, STIFFNESS * DEPTH))


def test_stepwise_positions_keep_the_sliding_force() -> None:
    """Nine ticks of standstill between jumps, as a decoded position has them: no return to the static limit."""
    scene = pressed()
    for jump in range(1, 60):
        for _ in range(10):
            force = scene.force((0.0004 * jump, 0.0, -DEPTH), TICK)
        if 0.0004 * jump > STATIC * DEPTH:
            assert force[0] == pytest.approx(-DYNAMIC * STIFFNESS * DEPTH)


@given(steps=st.lists(st.tuples(*[st.floats(-0.001, 0.001)] * 3), min_size=1, max_size=60))
def test_force_stays_in_cone_on_curved_surface(steps: list[Vector]) -> None:
    ball = SphereShape((0.0, 0.0, -0.03), 0.03)
    scene = Scene([SceneObject(ball, STIFFNESS, FrictionCone(static=STATIC, dynamic=DYNAMIC))])
    scene.force((0.0, 0.0, 0.01), TICK)
    x = y = 0.0
    z = -0.003
    for step in steps:
        x, y, z = x + step[0], y + step[1], min(0.01, max(-0.01, z + step[2]))
        force = scene.force((x, y, z), TICK)
        if scene.contacts:
            ((_, normal),) = ball.linearise((x, y, z))
            pressing = dot(force, normal)
            tangential = norm(subtract(force, (normal[0] * pressing, normal[1] * pressing, normal[2] * pressing)))
            assert pressing > 0.0
            assert tangential <= STATIC * pressing * (1.0 + 1e-6) + 1e-9
