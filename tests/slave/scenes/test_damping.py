import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.slave.scenes.solids import GROUND
from weberlink.geometry.vector import ZERO
from weberlink.slave.scenes.contact import SceneObject
from weberlink.slave.scenes.scene import Scene

TICK = 0.001


def damped() -> Scene:
    return Scene([SceneObject(GROUND, 500.0, None, 10.0)])


def test_pressing_in_is_resisted_by_speed() -> None:
    scene = damped()
    for i in range(1, 11):
        force = scene.force((0.0, 0.0, -0.0001 * i), TICK)
    assert force == pytest.approx((0.0, 0.0, 500.0 * 0.001 + 10.0 * 0.1))
    assert scene.force((0.0, 0.0, -0.001), TICK) == pytest.approx((0.0, 0.0, 0.5)), (
        "standing still there is only the spring"
    )


@given(heights=st.lists(st.floats(-0.01, 0.01), min_size=1, max_size=50), dt=st.floats(0.0, 0.01))
def test_it_never_pulls_and_ends_with_the_contact(heights: list[float], dt: float) -> None:
    scene = damped()
    scene.force((0.0, 0.0, 0.02), dt)
    for z in heights:
        force = scene.force((0.0, 0.0, z), dt)
        assert force[2] >= 0.0
        if z > 0.0:
            assert force == ZERO


def test_the_depth_before_a_new_touch_is_zero() -> None:
    scene = damped()
    scene.force((0.0, 0.0, -0.005), TICK)
    scene.force((0.0, 0.0, 0.001), TICK)
    assert scene.force((0.0, 0.0, -0.0001), TICK)[2] == pytest.approx(0.05 + 10.0 * 0.1)
