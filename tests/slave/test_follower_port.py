"""The port of a follower arm: how it engages, what it commands, what it shows, and when it holds."""

from itertools import pairwise
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
LOWER, UPPER = (-1.8, -1.2, 0.0), (1.8, 1.2, 0.9)
SPEED, APPROACH, RAMP = 4.0, 0.5, 0.05
PRESS, TRIP = (0.8, 0.8, 0.4), (2.0, 2.0, 1.0)


class Following:
    """A follower port in virtual time."""

    def __init__(self, arm: Servos | None = None, *, press: Joints = PRESS, trip: Joints = TRIP) -> None:
        self.arm = arm or Servos()
        presses = [
            axis_press_limit(most, stiffness, 0.0)
            for most, stiffness in zip(press, self.arm.spec.stiffness_nm_rad, strict=True)
        ]
        guard = Guard(
            [1, 1, 1], presses=presses, lower=LOWER, upper=UPPER, trips=trip, speed=SPEED, approach_speed=APPROACH,
            ramp=RAMP, trip_retract=TRIP_RETREAT,
        )  # fmt: skip
        self.joints, self.gripper = self.sensors = sensors_of(self.arm.spec, "torques")
        self.port = RobotPort(
            self.arm, guard=guard, sensors=self.sensors, endpoint=link(), by_button=True,
            fault=ArmFault,
        )  # fmt: skip
        self.now = 0.0
        self.trips = 0
        self.port.open(0.0)

    def sense(self) -> None:
        reading = self.port.latest(self.now)
        for sensor in self.sensors:
            assert sensor.complaint(reading) is None
            sensor.take(reading)
        self.trips += self.port.accept(reading)
        self.port.account(TICK, 0.0, encodes=True)

    def tick(self, *values: Joints | None, engaged: bool = True) -> Joints:
        """A tick; returns the angles commanded in it."""
        self.now += TICK
        self.port.actuate(values, self.now, TICK, TICK, engaged=engaged)
        self.sense()
        return self.arm.commands[-1]

    def there(self, *values: Joints) -> "Following":
        """Follows these angles, and shows all that it feels."""
        for _ in range(5000):
            self.tick(*values)
            row = self.row()
            if self.port.guard.arrived and not row.ramping:
                return self
        raise AssertionError("it never arrived")

    def shown(self) -> Joints:
        """What the operator may feel."""
        return self.joints.sample()[0] + self.gripper.sample()[0]

    def row(self) -> Row:
        row = Row()
        self.port.report(row, is_led=True)
        return row


def test_no_torque_is_shown_until_it_is_there_or_in_a_contact() -> None:
    """What nobody feels would be pressed on for as long as the other axis is on its way."""
    following = Following(Servos(walls=(-0.02, -inf, -inf)))
    shown = []
    for _ in range(400):
        following.tick((-0.05, 0.1), (0.0,))
        shown.append(following.joints.sample()[0][0])
    contact, arrival = (round(way / APPROACH / TICK) for way in (0.02, 0.1))
    assert shown[:contact] == [0.0] * contact
    assert shown[arrival] > 0.9 * 10.0 * 0.03
    assert max(b - a for a, b in pairwise(shown)) <= (0.3 / RAMP + 10.0 * APPROACH) * TICK * (1 + 1e-9)
    assert shown[-1] == pytest.approx(10.0 * 0.03)


def test_gripper_shows_its_torque_on_its_own_channel() -> None:
    following = Following(Servos(walls=(-inf, -inf, 0.3), angles=(0.0, 0.0, 0.4))).there((0.0, 0.0), (0.25,))
    assert following.joints.sample() == ((0.0, 0.0), (0.0, 0.0, 0.0), inf)
    assert following.gripper.sample()[0] == pytest.approx((5.0 * 0.05,))


def test_gripper_that_is_not_led_holds() -> None:
    following = Following(Servos(angles=(0.0, 0.0, 0.4))).there((0.1, 0.0))
    assert following.port.applied == (0.1, 0.0, 0.4)


@pytest.mark.parametrize("nothing", [None, (nan, 0.0), (inf, 0.0)])
def test_it_holds_while_nothing_of_use_is_decoded(nothing: Joints | None) -> None:
    following = Following().there((0.1, 0.0), (0.2,))
    assert [following.tick(nothing, (0.9,)) for _ in range(3)] == [(0.1, 0.0, 0.2)] * 3
    assert following.port.account(TICK, 0.0, encodes=True) == 0, "an arm hands no energy over"


def test_arm_that_sags_keeps_a_light_load_up() -> None:
    following = Following(Servos(sag=0.07)).there((0.5, 0.0), (0.5,))
    following.arm.load = (-0.3, 0.0, 0.0)
    for _ in range(1000):
        following.tick((0.5, 0.0), (0.5,))
    assert following.port.applied[0] == 0.5


def test_arm_that_opens_without_angles_is_closed_again() -> None:
    arm = Servos(angles=(nan, 0.0, 0.0))
    with pytest.raises(ArmFault, match="nan"):
        Following(arm)
    assert not arm.is_open


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
    row = following.row()
    port.report(row, is_led=False)
    assert row.ramping == RELEASED
