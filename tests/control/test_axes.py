"""The account of torques: the bound of all axes together, and what is displayed within it."""

from random import Random

import pytest

from tests.control.teleoperation import ACCOUNT, TICK
from weberlink.control.axes import LEVER, BoundedAxes, DirectAxes, build_axes


@pytest.mark.parametrize("seed", range(5))
def test_no_torques_give_more_than_the_bound(seed: int) -> None:
    """Joints that move with the torques on them, whatever is asked for."""
    random, axes = Random(seed), BoundedAxes(LEVER, ACCOUNT)
    angles, torques = (0.0,) * 7, (0.0,) * 7
    out = most = 0.0
    allowed = ACCOUNT.allowance
    for _ in range(3000):
        ways = [2.0 * TICK * random.uniform(-0.1, 1.0) * (1.0 if torque >= 0.0 else -1.0) for torque in torques]
        given = sum(torque * way for torque, way in zip(torques, ways, strict=True))
        angles = tuple(angle + way for angle, way in zip(angles, ways, strict=True))
        axes.observe(angles, TICK)
        out, most = out + given, max(most, given)
        allowed += ACCOUNT.refill * TICK + ACCOUNT.damping * LEVER**2 * sum(way * way for way in ways) / TICK
        assert out <= allowed + most + 1e-9
        torques = axes.render(tuple(random.uniform(-2.0, 2.0) for _ in range(7)))
        axes.displayed(torques)
    assert out > ACCOUNT.allowance


def test_what_the_hand_presses_in_is_displayed_as_decoded() -> None:
    axes, torque = BoundedAxes(LEVER, ACCOUNT), 0.0
    for step in range(1, 100):
        axes.observe((-1e-3 * step,), TICK)
        torque = 2.0 * step * 1e-3
        assert axes.render((torque,)) == (torque,)
        axes.displayed((torque,))


def test_none_displays_what_is_decoded() -> None:
    assert isinstance(build_axes("none", LEVER, ACCOUNT), DirectAxes)
    assert DirectAxes().render((3.0, -2.0)) == (3.0, -2.0)
