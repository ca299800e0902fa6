"""The port of a robot or an arm: what is commanded, and what is shown, in every state of a session."""

from collections.abc import Sequence
from itertools import pairwise
from math import inf, nan, pi, sin
from types import SimpleNamespace
from typing import Any, Self

import pytest
from hypothesis import given, strategies as st

from tests.arms.ends import TICK, Servos, link, sensors
from tests.compiled import replaces_methods
from tests.examples import examples
from tests.slave.scenes.solids import wall
from weberlink.arms.contract import ArmFault
from weberlink.codec import Encoder, force_channel
from weberlink.codec.outgoing import OutgoingChannel
from weberlink.control.contract import LEAST_CONTACT, SlaveControl
from weberlink.control.port import Port
from weberlink.geometry.joints import Joints
from weberlink.geometry.rotation import IDENTITY, Quaternion, angle_between, quaternion
from weberlink.geometry.vector import ZERO, Vector, scale
from weberlink.slave.guard import TRIP_PAUSE, TRIP_RETREAT, Guard, PressLimit, axis_press_limit
from weberlink.slave.robot_port import ContactForce, RobotPort
from weberlink.slave.robots.contract import RobotFault, RobotReading, RobotSpec
from weberlink.slave.robots.simulated import SimulatedOptions, SimulatedRobot
from weberlink.slave.rotation import ToolOrientation, ToolTorque
from weberlink.telemetry.record import RELEASED
from weberlink.telemetry.row import Row

pytestmark = replaces_methods  # `Tip` and `link` stand in for compiled classes
LOW, HIGH = (-0.1, -0.1, -0.1), (0.1, 0.1, 0.1)
SPEED, APPROACH, RAMP = 1.0, 0.1, 0.05
TURN, TURN_APPROACH = 20.0, 1.0
TRIP_N, MOST_N, COUPLING = 20.0, 6.0, 1000.0
RETRACT, TRIP_RETRACT = 0.005, 0.01
UP: Vector = (0.0, 0.0, 1.0)


class Tip:
    """A robot that is at its command at once, under the force and torque of a test."""

    spec = RobotSpec("tip", "xyz", 1e4, COUPLING, (LOW, HIGH), 1000.0, True, torque_n_m=1.0)

    def __init__(self, at: Vector) -> None:
        self.at, self.force, self.torque = at, ZERO, ZERO
        self.commands: list[Vector] = []
        self.turns: list[Quaternion] = []
        self.is_open = self.stays = False
        self.follows = True

    def open(self, now: float) -> None:
        self.is_open = True

    def latest(self, now: float) -> RobotReading:
        return RobotReading(now, self.at, self.force, torque=self.torque)

    def command(self, position: Vector, now: float) -> None:
        self.commands.append(position)
        if self.follows:
            self.at = position

    def point(self, orientation: Quaternion, now: float) -> None:
        self.turns.append(orientation)

    def stay(self) -> None:
        self.stays = True

    def close(self) -> None:
        self.is_open = False


def sampled(channel: OutgoingChannel) -> Joints:
    """What is sent of it now."""
    channel.sample(0)
    return channel.sampled


class Following:
    """A port in virtual time: a robot or an arm with its guard, its sensors, and a tool that turns."""

    def __init__(self, robot: Any, guard: Guard, sensors: Sequence[Any], **parts: Any) -> None:
        self.robot, self.guard, self.sensors = robot, guard, list(sensors)
        self.tool = parts.get("tool")
        self.port = RobotPort(robot, guard=guard, sensors=sensors, endpoint=link(), by_button=True, **parts)
        self.now, self.trips = 0.0, 0
        self.port.open(0.0)

    def tick(self, *values: Joints | None, engaged: bool = True) -> Joints:
        """Sense, then actuate; returns what was commanded."""
        self.now += TICK
        reading = self.port.latest(self.now)
        for sensor in self.sensors:
            sensor.take(reading)
        self.trips += self.port.accept(reading)
        values += (ZERO,) if self.tool is not None and len(values) == 1 else ()
        self.port.actuate(values, self.now, TICK, TICK, engaged=engaged)
        self.port.account(TICK, TICK, encodes=True)
        commanded: Joints = self.robot.commands[-1]
        return commanded

    def there(self, *values: Joints) -> Self:
        """Follows, and shows all that it feels."""
        for _ in range(10_000):
            is_there = self.guard.arrived and not self.row().ramping
            self.tick(*values)
            if is_there:
                return self
        raise AssertionError("it never arrived")

    def row(self, *, is_led: bool = True) -> Row:
        row = Row()
        self.port.report(row, is_led=is_led)
        return row


class FollowingTip(Following):
    """Of a robot; `most` is its press limit [N]."""

    def __init__(self, at: Vector = ZERO, *, most: float = inf, retract: float = RETRACT) -> None:
        guard = Guard(
            [PressLimit(most, COUPLING, damping=100.0, contact=LEAST_CONTACT)], workspace=(LOW, HIGH), trips=(TRIP_N,),
            speed=SPEED, approach_speed=APPROACH, ramp=RAMP, trip_retract=TRIP_RETRACT, retract=retract,
        )  # fmt: skip
        tool = ToolOrientation(speed=TURN, approach_speed=TURN_APPROACH, ramp=RAMP)
        self.force = ContactForce(Encoder(force_channel()), COUPLING)
        super().__init__(Tip(at), guard, [self.force], control=SlaveControl(), tool=tool)
        self.torque = ToolTorque(Encoder(force_channel()), self.port.shown, tool)
        self.sensors.append(self.torque)


class FollowingArm(Following):
    """Of an arm with a gripper."""

    def __init__(self, **how: Any) -> None:
        arm = Servos(**how)
        presses = [axis_press_limit(m, k, 0.0) for m, k in zip((0.8, 0.8, 0.4), arm.spec.stiffness_nm_rad, strict=True)]
        guard = Guard(
            presses, workspace=((-1.8, -1.2, 0.0), (1.8, 1.2, 0.9)), trips=(2.0, 2.0, 1.0),
            speed=4.0, approach_speed=0.5, ramp=0.05, trip_retract=TRIP_RETREAT,
        )  # fmt: skip
        super().__init__(arm, guard, sensors("torques", arm.spec), fault=ArmFault)


@pytest.mark.parametrize("interruption", ["lose", "idle", "release", "reset", "settle"])
@pytest.mark.parametrize("ticks", [0, round(RAMP / TICK) + 1])
def test_after_any_interruption_the_robot_holds_and_the_next_command_is_approached(
    interruption: str, ticks: int
) -> None:
    following = FollowingTip().there((0.01, 0.0, 0.0))
    port = following.port
    assert following.tick((0.0105, 0.0, 0.0)) == (0.0105, 0.0, 0.0), "it follows without delay"
    led = ((0.09, 0.0, 0.0), (0.0, 0.0, 1.0)) if interruption == "idle" else (None, None)
    if interruption in ("lose", "idle"):
        following.tick(*led, engaged=interruption == "lose")
    else:
        {"release": lambda: port.release(retreat=True), "reset": port.reset, "settle": lambda: port.settle(0.0)}[
            interruption
        ]()
        assert (port.shown(UP) == ZERO) == (interruption != "release"), "the beginning of a session shows nothing"
    for _ in range(ticks):
        assert following.tick(*led, engaged=interruption != "idle") == (0.0105, 0.0, 0.0)
    assert ticks == 0 or port.shown(UP) == ZERO
    assert following.tick((0.09, 0.0, 0.0), (0.0, 0.0, 1.0))[0] == pytest.approx(0.0105 + APPROACH * TICK)
    assert angle_between(IDENTITY, following.robot.turns[-1]) == pytest.approx(TURN_APPROACH * TICK)


def test_the_control_is_told_what_is_encoded_and_gives_its_credit() -> None:
    following, told = FollowingTip().there((0.01, 0.0, 0.0)), list[Any]()
    port: Any = following.port
    port._control = SimpleNamespace(observe=lambda *values: told.append(values), credit=3)
    assert port.account(TICK, TICK, encodes=False) == 3
    assert told == []
    port.account(TICK, TICK, encodes=True)
    assert told == [(port.applied, following.force.value)]


@pytest.mark.parametrize(("newtons", "hidden"), [(0.99 * LEAST_CONTACT, round(0.2 / TURN_APPROACH / TICK)), (2.0, 1)])
def test_force_and_torque_fade_in_once_the_robot_is_there_in_every_channel_or_in_a_contact(
    newtons: float, hidden: int
) -> None:
    """The tool is the last to be there; a robot in a contact would press on unfelt until then."""
    following = FollowingTip()
    force = following.robot.force = scale((0.6, 0.0, 0.8), newtons)
    following.robot.torque = (0.0, 0.1, 0.0)
    shown = []
    turn = (0.0, 0.0, 0.2)
    for _ in range(400):
        following.tick((0.005, 0.0, 0.0), turn)
        felt = sampled(following.force)
        assert felt == pytest.approx(scale(force, felt[2] / force[2])), "of one direction"
        shown.append((felt[2], sampled(following.torque)[1]))
    assert set(shown[: hidden - 1]) <= {(0.0, 0.0)} and shown[hidden + 1] > (0.0, 0.0)
    assert max(b[0] - a[0] for a, b in pairwise(shown)) <= 2.0 * force[2] * TICK / RAMP
    assert shown[-1] == pytest.approx((force[2], 0.1))
    assert following.torque.sample(0) == (turn, inf)
    assert not following.row().ramping


def test_a_force_above_the_limit_trips_once_and_hand_and_tool_hold() -> None:
    following = FollowingTip().there(ZERO, (0.0, 0.0, 0.1))
    following.robot.force = (0.0, 0.0, TRIP_N)
    following.tick(ZERO, (0.0, 0.0, 0.1))
    assert (following.trips, following.port.tripped) == (0, False), "a reading at the limit is not above it"
    following.robot.force = (0.0, 0.0, TRIP_N * (1.0 + 1e-6))
    turned = following.robot.turns[-1]
    for _ in range(round(TRIP_PAUSE / TICK)):
        following.tick((0.0, 0.0, -0.05), (0.0, 0.0, 1.0))
    assert (following.trips, following.port.follows, following.port.tripped) == (1, False, True)
    assert following.port.applied == pytest.approx((0.0, 0.0, TRIP_RETRACT), abs=1e-6)
    assert following.robot.turns[-1] == turned
    following.tick((0.0, 0.0, 2.0 * TRIP_RETRACT))
    assert following.port.tripped, "led out, but the contact is still too strong"
    following.robot.force = ZERO
    following.tick((0.0, 0.0, -0.05))
    assert not following.port.follows, "not led out yet"
    following.tick((0.0, 0.0, 2.0 * TRIP_RETRACT))
    assert following.tick((0.0, 0.0, 2.0 * TRIP_RETRACT))
    assert following.port.follows, "led out, after the pause"


@pytest.mark.parametrize(
    ("retract", "told", "ends"), [(RETRACT, True, 0.003 + RETRACT), (RETRACT, False, 0.0), (0.0, True, 0.0)]
)
def test_a_release_backs_off_a_contact_only_if_told(retract: float, told: bool, ends: float) -> None:
    """From where the robot is, not from where it was commanded."""
    following = FollowingTip(retract=retract).there(ZERO)
    robot = following.robot
    robot.follows, robot.at, robot.force = False, (0.0, 0.0, 0.003), (0.0, 0.0, 5.0)
    following.tick(ZERO)
    following.port.release(retreat=told)
    for _ in range(200):
        following.tick(None, None, engaged=False)
    assert following.port.applied == pytest.approx((0.0, 0.0, ends))


def test_the_robot_presses_with_no_more_than_the_limit() -> None:
    following = FollowingTip(most=MOST_N).there(ZERO)
    robot = following.robot
    robot.follows = False
    assert following.row().contact_ticks == 0
    for tick in range(1000):
        robot.force = (0.0, 0.0, max(0.0, -COUPLING * following.port.applied[2]))
        following.tick((0.0, 0.0, max(-0.05, -1e-4 * tick)))
    assert following.port.applied[2] == pytest.approx(-MOST_N / COUPLING, rel=0.02)
    assert following.row().contact_ticks == following.guard.contact_ticks > 500
    assert following.port.led(0) == (0.0, 0.0, -0.05), "where it is led, whether it goes there or not"
    following.tick(ZERO, engaged=False)
    assert following.port.led(0) is None


def test_after_a_pause_the_press_limit_acts_as_a_new_one() -> None:
    """An excess that was not there a tick ago stops the command; one that was there before it goes on moves it out."""
    following = FollowingTip(most=MOST_N).there(ZERO)
    following.robot.follows, following.robot.force = False, (0.0, 0.0, 3.0)
    following.tick((0.0, 0.0, -0.001))
    following.robot.at = (0.0, 0.0, 0.02)
    held = following.tick(None, engaged=False)
    assert following.tick((0.0, 0.0, -0.05))[2] > held[2]


def test_after_a_stall_it_holds_with_the_force_that_it_presses_with() -> None:
    following = FollowingTip().there((0.0, 0.0, 0.02))
    following.robot.at, following.robot.force = (0.01, 0.0, 0.0), (1.0, -2.0, 5.0)
    following.port.settle(following.now)
    pressing = pytest.approx((0.01 - 1.0 / COUPLING, 2.0 / COUPLING, -5.0 / COUPLING))
    assert following.tick(None, None, engaged=False) == pressing
    before = following.port.applied
    for force in ((nan, 0.0, 0.0), (inf, 0.0, 0.0)):
        following.robot.force = force
        following.port.settle(following.now)
        following.robot.force = ZERO
        assert following.tick(None, None, engaged=False) == before, "of no use, it is not used"


@pytest.mark.parametrize(("at", "force"), [((nan, 0.0, 0.0), ZERO), (ZERO, (0.0, inf, 0.0))])
def test_a_reading_of_no_use_is_named_and_ends_the_opening(at: Vector, force: Vector) -> None:
    following = FollowingTip()
    port = following.port
    assert following.force.complaint(RobotReading(0.0, ZERO, ZERO)) is None
    assert "reports" in (following.force.complaint(RobotReading(0.0, at, force)) or "")
    following.robot.at, following.robot.force = at, force
    with pytest.raises(RobotFault, match="tip reports"):
        port.open(0.0)
    assert not following.robot.is_open


def test_it_is_a_port_and_its_record_says_what_it_did() -> None:
    following = FollowingTip()
    port: Port = following.port
    assert (port.kind, port.leads, port.at_rest, port.tripped, port.trouble) == ("robot", False, True, False, None)
    following.there((0.01, 0.0, 0.0), (0.0, 0.0, 0.3))
    following.tick((9.0, 0.0, 0.0), (0.0, 0.0, 0.3))
    row = following.row()
    assert following.port.commanded == (9.0, 0.0, 0.0)
    assert row.clipped
    assert following.tool.applied == pytest.approx((0.0, 0.0, 0.3))
    assert following.row().ramping is False
    assert following.row(is_led=False).ramping == RELEASED
    following.tick(following.port.applied, (0.0, 0.0, 2.0))
    assert following.row().clipped, "the tool is limited"
    shown = following.port.shown(UP)
    told = len(following.robot.commands)
    following.port.halt(following.now)
    assert following.robot.commands[told:] == [following.port.applied]
    assert following.robot.turns[-1] == following.robot.turns[-2] and following.robot.stays
    assert following.port.shown(UP) == shown
    port.close()
    assert not following.robot.is_open
    assert following.torque.complaint(RobotReading(0.0, ZERO, ZERO, torque=(1e9, 0.0, 0.0))) is not None
    assert following.torque.complaint(RobotReading(0.0, ZERO, ZERO, torque=(9e8, 0.0, 0.0))) is None


@given(st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)), max_size=40))
def test_the_tool_turns_no_faster_than_it_may(turns: list[Vector]) -> None:
    following, last, there = FollowingTip(), IDENTITY, False
    for turn in turns:
        following.tick(ZERO, turn)
        applied = following.robot.turns[-1]
        assert angle_between(last, applied) <= (TURN if there else TURN_APPROACH) * TICK * (1 + 1e-6) + 1e-9
        assert following.tool.clipped == (there and applied != quaternion(turn))
        last, there = applied, following.tool.arrived


# --- the sample of the force


@given(
    stiffness=st.sampled_from([500.0, 1e4, 1e7]),
    mass=st.sampled_from([0.005, 0.1, 1.0]),
    coupling=st.floats(500.0, 5000.0),
    frequency=st.floats(1.0, 10.0),
)
@examples(20)
def test_samples_of_a_moving_robot_lie_on_the_static_line_of_the_wall(
    stiffness: float, mass: float, coupling: float, frequency: float
) -> None:
    """At any speed, they are the force of two springs in series, at a command that no lag has touched."""
    options = SimulatedOptions(mass_kg=mass, stiffness_n_m=coupling, force_n=1e4)
    robot, felt = SimulatedRobot(options, wall(stiffness), TICK), ContactForce(Encoder(force_channel()), coupling)
    series = stiffness * coupling / (stiffness + coupling)
    robot.open(0.0)
    touched, lag = 0, 0.0
    for tick in range(1, 1001):
        command = (0.0, 0.0, 0.02 * sin(2.0 * pi * frequency * tick * TICK))
        robot.command(command, tick * TICK)
        felt.take(robot.latest(tick * TICK))
        rest, most = felt.sample(tick)
        value = felt.sampled
        assert most == inf
        if value == ZERO:
            continue
        touched += 1
        assert value[2] == pytest.approx(-series * rest[2], rel=1e-6, abs=1e-9 * stiffness)
        lag = max(lag, abs(value[2] + series * command[2]))
    assert touched > (1 if stiffness == 1e7 else 10)  # such a wall throws the robot out: at 10 Hz it touches twice
    assert lag > 0.05  # [N] off the line, if paired with the command


# --- an arm, where it differs


def test_gripper_shows_its_torque_on_its_own_channel() -> None:
    following = FollowingArm(walls=(-inf, -inf, 0.3), angles=(0.0, 0.0, 0.4)).there((0.0, 0.0), (0.25,))
    joints, gripper = following.sensors
    assert sampled(joints) == (0.0, 0.0)
    assert sampled(gripper) == pytest.approx((5.0 * 0.05,))


@pytest.mark.parametrize("nothing", [None, (nan, 0.0), (inf, 0.0)])
def test_it_holds_while_nothing_of_use_is_decoded(nothing: Joints | None) -> None:
    following = FollowingArm().there((0.1, 0.0), (0.2,))
    assert [following.tick(nothing, (0.9,)) for _ in range(3)] == [(0.1, 0.0, 0.2)] * 3
    assert following.port.account(TICK, 0.0, encodes=True) == 0, "an arm hands no energy over"


def test_after_a_stall_an_arm_holds_without_pressing_more() -> None:
    following = FollowingArm(sag=0.05).there((0.5, 0.0), (0.5,))
    following.port.settle(following.now)
    assert following.tick(None, None, engaged=False) == (0.5, 0.0, 0.5), "it does not sag twice"
    following.robot.angles = (0.0, 0.0, 0.5)
    following.port.settle(following.now)
    assert following.tick(None, None, engaged=False) == pytest.approx((0.08, 0.0, 0.5))
