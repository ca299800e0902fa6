"""Six degrees of freedom: what the laws of all sessions do not say, and what is felt in the shipped files."""

from math import degrees, sin
from typing import Any

import numpy as np
import pytest

from tests.session.kinds import INTERRUPTIONS, TICK, TURNING, interrupted, run
from weberlink.geometry.rotation import LONGEST, angle_between, quaternion
from weberlink.master.devices.contract import DeviceReading
from weberlink.master.devices.operator import OperatorDevice


def apart(one: Any, other: Any) -> Any:
    """Angles between rotation vectors, row by row [rad]."""
    pairs = zip(one.tolist(), other.tolist(), strict=True)
    return np.array([angle_between(quaternion(tuple(a)), quaternion(tuple(b))) for a, b in pairs])


def test_a_contact_is_felt_while_the_tool_is_still_turned_otherwise_than_the_hand() -> None:
    """A tool that turns slowly to where the hand is does not press on unfelt meanwhile; the torque fades in."""
    ran = interrupted(TURNING, INTERRUPTIONS["cut both ways"], "slave.limits.approach_turn_rad_s=0.2")
    end = ran.at(TURNING.begin + 0.6 + 0.05)  # the link brings the first news, and the hand is led again
    master, slave = ran.master[end:], ran.slave[end:]
    assert apart(slave["rotation_output"], master["rotation_raw"]).min() > 0.05
    for felt, there in (("output", "raw"), ("rotation_output", "rotation_raw")):
        shown, stated = (np.linalg.norm(each, axis=1) for each in (master[felt], slave[there]))
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
    vectors = ran.master["rotation_raw"]
    assert (np.linalg.norm(np.diff(vectors, axis=0), axis=1) > 0.1).sum() == 2
    assert np.linalg.norm(vectors, axis=1).max() <= LONGEST
    led = ran.slave["ramping"] == 0
    away = apart(ran.slave["rotation_output"], vectors)[led]
    assert led.sum() > 2000 and away.max() <= 5.0 * TICK * late + 0.006, "at most 5 rad/s, and the deadband"


def test_the_stick_tells_by_torque_which_end_touches_until_it_is_laid_flat() -> None:
    ran = run(TURNING, 8.1)
    held, meant = ran.slave["rotation_output"], ran.master["rotation_raw"]
    assert np.linalg.norm(held[501:] - meant[500:-1], axis=1).max() < 0.02, "as the hand was a tick ago"
    force, measured, felt = ran.slave["raw"], ran.slave["rotation_raw"], ran.master["rotation_output"]
    # The end on +x is low and presses: the torque is about -y, that force times 3 cm times the cosine of 20 degrees.
    assert force[1650, 2] > 1.0
    assert measured[1650, 1] == pytest.approx(-0.03 * 0.94 * force[1650, 2], rel=0.03)
    assert felt[1650, 1] == pytest.approx(measured[1650, 1], rel=0.15)
    # Turned flat, and pressed: more force, and no torque about the plane.
    assert force[3050:3150, 2].min() > 2.5
    assert np.linalg.norm(measured[3050:3150, :2], axis=1).max() < 0.1 * abs(measured[1650, 1])
    # Swung about the vertical, both ends rub against it: first about +z, on the way back about -z.
    assert measured[3200:4100, 2].max() > 0.01 and measured[4200:5100, 2].min() < -0.01
    # One end on the box, then the other on the table as well, and little torque is left.
    assert measured[6300:6800, 1].min() < -0.025
    assert np.abs(measured[7800:8000, 1]).max() < 0.01
    assert degrees(ran.slave["rotation_output"][7900, 1]) == pytest.approx(-10.0, abs=1.0)
