"""The port of a follower arm, beside what it has in common with that of a robot: what it commands, shows and holds."""

from math import inf, nan

import pytest

from tests.arms.ends import TICK, Servos, link
from tests.compiled import replaces_methods
from weberlink.arms.contract import ArmFault
from weberlink.arms.sensor import sensors_of
from weberlink.geometry.joints import Joints
from weberlink.slave.guard import TRIP_RETREAT, Guard, axis_press_limit
from weberlink.slave.robot_port import RobotPort
from weberlink.telemetry.record import RELEASED
from weberlink.telemetry.row import Row

pytestmark = replaces_methods  # `link` stands in for an endpoint, a compiled class


class Following:
    """A follower port in virtual time."""

    def __init__(self, arm: Servos) -> None:
        presses = [
            axis_press_limit(most, stiffness, 0.0)
            for most, stiffness in zip((0.8, 0.8, 0.4), arm.spec.stiffness_nm_rad, strict=True)
        ]
        self.guard = Guard(
            [1, 1, 1], presses=presses, lower=(-1.8, -1.2, 0.0), upper=(1.8, 1.2, 0.9), trips=(2.0, 2.0, 1.0),
            speed=4.0, approach_speed=0.5, ramp=0.05, trip_retract=TRIP_RETREAT,
        )  # fmt: skip
        self.arm, self.now = arm, 0.0
        self.joints, self.gripper = self.sensors = sensors_of(arm.spec, "torques")
        self.port = RobotPort(
            arm, guard=self.guard, sensors=self.sensors, endpoint=link(), by_button=True, fault=ArmFault
        )
        self.port.open(0.0)

    def tick(self, *values: Joints | None, engaged: bool = True) -> Joints:
        """A tick; returns the angles commanded in it."""
        self.now += TICK
        self.port.actuate(values, self.now, TICK, TICK, engaged=engaged)
        reading = self.port.latest(self.now)
        for sensor in self.sensors:
            sensor.take(reading)
        self.port.accept(reading)
        return self.arm.commands[-1]

    def there(self, *values: Joints) -> "Following":
        """Follows these angles, and shows all that it feels."""
        for _ in range(5000):
            self.tick(*values)
            if self.guard.arrived and self.guard.share == 1.0:
                return self
        raise AssertionError("it never arrived")


def test_gripper_shows_its_torque_on_its_own_channel() -> None:
    following = Following(Servos(walls=(-inf, -inf, 0.3), angles=(0.0, 0.0, 0.4))).there((0.0, 0.0), (0.25,))
    assert following.joints.sample() == ((0.0, 0.0), (0.0, 0.0, 0.0), inf)
    assert following.gripper.sample()[0] == pytest.approx((5.0 * 0.05,))


def test_gripper_that_is_not_led_holds() -> None:
    following = Following(Servos(angles=(0.0, 0.0, 0.4))).there((0.1, 0.0))
    assert following.port.applied == (0.1, 0.0, 0.4)


@pytest.mark.parametrize("nothing", [None, (nan, 0.0), (inf, 0.0)])
def test_it_holds_while_nothing_of_use_is_decoded(nothing: Joints | None) -> None:
    following = Following(Servos()).there((0.1, 0.0), (0.2,))
    assert [following.tick(nothing, (0.9,)) for _ in range(3)] == [(0.1, 0.0, 0.2)] * 3
    assert following.port.account(TICK, 0.0, encodes=True) == 0, "an arm hands no energy over"


def test_after_a_stall_it_holds_without_pressing_more() -> None:
    following = Following(Servos(sag=0.05)).there((0.5, 0.0), (0.5,))
    following.port.settle(following.now)
    assert following.tick(None, None, engaged=False) == (0.5, 0.0, 0.5), "it does not sag twice"
    following.arm.angles = (0.0, 0.0, 0.5)
    following.port.settle(following.now)
    assert following.tick(None, None, engaged=False) == pytest.approx((0.08, 0.0, 0.5))


def test_record_has_where_it_is_and_what_it_feels() -> None:
    following = Following(Servos(walls=(-0.02, -inf, -inf))).there((-0.05, 0.1), (0.2,))
    port = following.port
    assert (port.applied, port.where) == ((-0.05, 0.1, 0.2), (-0.02, 0.1, 0.2))
    assert port.shown(port.felt) == pytest.approx((0.3, 0.0, 0.0))
    row = Row()
    port.report(row, is_led=False)
    assert row.ramping == RELEASED
