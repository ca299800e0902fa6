"""Six degrees of freedom: what the laws of all sessions do not say."""

from math import sin
from typing import Any

import numpy as np
import pytest

from tests.session.kinds import INTERRUPTIONS, TICK, TURNING, interrupted, run
from weberlink.geometry.rotation import LONGEST, angle_between, quaternion
from weberlink.master.devices.contract import DeviceReading
from weberlink.master.devices.operator import OperatorDevice
from weberlink.telemetry.record import FORCE, TORQUE


def apart(one: Any, other: Any) -> Any:
    """Angles between rotation vectors, row by row [rad]."""
    pairs = zip(one.tolist(), other.tolist(), strict=True)
    return np.array([angle_between(quaternion(tuple(a)), quaternion(tuple(b))) for a, b in pairs])


def test_a_contact_is_felt_while_the_tool_is_still_turned_otherwise_than_the_hand() -> None:
    """A tool that turns slowly to where the hand is does not press on unfelt meanwhile; the torque fades in."""
    ran = interrupted(TURNING, INTERRUPTIONS["cut both ways"], "slave.limits.approach_turn_rad_s=0.2")
    end = ran.at(TURNING.begin + 0.6 + 0.05)  # the link brings the first news, and the hand is led again
    master, slave = ran.master[end:], ran.slave[end:]
    assert apart(slave["output"][:, TORQUE], master["raw"][:, TORQUE]).min() > 0.05
    for part in (FORCE, TORQUE):
        shown, stated = (np.linalg.norm(each[:, part], axis=1) for each in (master["output"], slave["raw"]))
        assert shown[0] < 0.1 * stated[0]
        assert np.median(shown[100:] / stated[100:]) == pytest.approx(1.0, abs=0.1)


class Turning(OperatorDevice):
    """A hand that turns on and on about one axis, through half a turn and back to where it was, and trembles."""

    def latest(self, now: float) -> DeviceReading:
        angle = 3.0 * now + 0.02 * sin(100.0 * now)
        return super().latest(now)._replace(orientation=quaternion((0.6 * angle, 0.8 * angle, 0.0)))


@pytest.mark.parametrize(("delay", "loss", "late"), [(0, 0.0, 0), (5, 0.3, 40)])
def test_a_hand_that_turns_through_half_a_turn_is_followed(delay: int, loss: float, late: int) -> None:
    """The vector jumps; the rotation does not, and neither does what the tool is told, whatever the link does."""
    link = f"link.emulate={{delay_ms: {delay}, loss: {loss}, seed: 1}}"
    fast = ("slave.limits.approach_turn_rad_s=10", "slave.limits.turn_rad_s=1000")
    ran = run(TURNING, 3.3, link, *fast, device=Turning)
    vectors = ran.master["raw"][:, TORQUE]
    assert (np.linalg.norm(np.diff(vectors, axis=0), axis=1) > 0.1).sum() == 2
    assert np.linalg.norm(vectors, axis=1).max() <= LONGEST
    led = ran.slave["ramping"] == 0
    away = apart(ran.slave["output"][:, TORQUE], vectors)[led]
    assert led.sum() > 2000 and away.max() <= 5.0 * TICK * late + 0.006, "at most 5 rad/s, and the deadband"
