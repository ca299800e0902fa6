"""The follower `so101_follower`: an SO-101 arm under the position control of its servos.

The torque of the environment is estimated from what the motors exert and what the weight of the arm takes:

    external = gravity - motor,    less the friction of the gears within which nothing can be told

A load is the duty of a motor's bridge, not a torque; 345:1 gears with friction lie between. So this is coarse, and in
newton metres by a calibration only.
"""

from collections.abc import Callable
from contextlib import suppress
from enum import StrEnum
from math import copysign, expm1, pi
from time import monotonic, sleep
from typing import Annotated, ClassVar, Final

from pydantic import Field

from weberlink.arms.contract import ArmSpec
from weberlink.arms.threaded_arm import ArmSample, ThreadedArm
from weberlink.geometry.joints import Joints
from weberlink.hardware.discovery import PluggedDevice, UsbId, only, serial_ports
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.guardian import HoldingGuardian
from weberlink.hardware.serial_port import SerialPort
from weberlink.registry import Tier
from weberlink_arms.feetech import packet, registers
from weberlink_arms.feetech.arm import JOINTS, NAMES, SixPositive, So101Options, motor_torques
from weberlink_arms.feetech.bus import USB, ServoPort
from weberlink_arms.feetech.exchange import So101Bus
from weberlink_arms.feetech.registers import (
    FULL_LOAD,
    GOAL_POSITION,
    ORDER_ADDRESS,
    ORDER_SIZE,
    POSITION,
    TORQUE_ENABLE,
    Present,
)
from weberlink_arms.giving_way import SETTLE_S, give_way

NAME: Final = "so101_follower"
STALL_NM: Final = 1.91
"""Of the C001 (1/345) at 7.4 V, by the vendor: 19.5 kg cm; the C018 has 2.94 N m (30 kg cm) at 12 V."""
STALE_S: Final = 0.1
LEASE_S: Final = 0.1
"""Beyond two cycles, time without one after which the guardian takes this process for stopped [s]."""
REPEATS: Final = 6
"""Requests in the guardian's message; together longer than a message that it may cut, so that one arrives whole."""
WATCH_EVERY: Final = 25
"""Cycles between two checks of a servo's torque."""
GRAVITY_NM: Final = 0.9
"""Largest torque of the arm's own weight, by its model stretched out from the shoulder."""
LOAD_ERROR: Final = 0.3
CALIBRATED_ERROR: Final = 0.1
"""Share of a torque by the data sheet, and by a calibration, that may be wrong; chosen, not measured."""

Gravity = Callable[[Joints], Joints]
"""Torques of all axes [N m] that hold the arm at these angles [rad]."""
Limit = Annotated[int, Field(ge=50, le=1000)]
Friction = Annotated[float, Field(ge=0.0, le=5.0)]


class OnClose(StrEnum):
    """How the arm is left; `hold` is the default, since without torque the arm drops."""

    HOLD = "hold"
    LIMP = "limp"


class So101FollowerOptions(So101Options):
    """Options of `so101_follower`. Tuples: shoulder_pan, shoulder_lift, elbow_flex, wrist_flex, wrist_roll, gripper."""

    ORDERS: ClassVar[int] = packet.OVERHEAD + 2 + 6 * (1 + GOAL_POSITION.size)

    p_gain: int = Field(default=16, ge=4, le=64, description="of the servos' position control; 16 as LeRobot sets it")
    torque_limit: tuple[Limit, Limit, Limit, Limit, Limit, Limit] = Field(
        default=(1000, 1000, 1000, 1000, 1000, 500), description="of the servos, in 0.1 % of their stall torque"
    )
    on_close: OnClose = Field(
        default=OnClose.HOLD, description="hold: the servos hold the arm where it is, and push no more; limp: it drops"
    )
    stall_nm: float = Field(
        default=STALL_NM, gt=0.0, le=10.0, description="stall torque of the servos at rated_v; 2.94 for 12 V servos"
    )
    torque_per_amp_nm: SixPositive | None = Field(
        default=None, description="torque of a current of 1 A, by a calibration; then the current counts, not the load"
    )
    gravity: bool = Field(default=True, description="subtract the weight of the arm, by its model")
    friction_nm: tuple[Friction, Friction, Friction, Friction, Friction, Friction] = Field(
        default=(0.15, 0.15, 0.15, 0.15, 0.15, 0.15), description="of the gears: torques below it count as none"
    )
    torque_cutoff_hz: float = Field(
        default=10.0, gt=0.0, le=1e3, description="of the low-pass on the estimated torques"
    )

    @property
    def per_load(self) -> Joints:
        """Torque of a load of 0.1 % [N m]."""
        return self.torque_per_load_nm or (self.stall_nm / FULL_LOAD,) * 6

    @property
    def stiffness(self) -> Joints:
        """Of the position control [N m/rad]."""
        return tuple(self.p_gain * registers.DUTY_PER_P_RAD * FULL_LOAD * each for each in self.per_load)

    @property
    def calibrated(self) -> bool:
        return self.torque_per_load_nm is not None or self.torque_per_amp_nm is not None


class So101Follower(ThreadedArm[Joints | None]):
    """An SO-101 follower arm. Its servos have no watchdog: when this process stops, a guardian lets them hold the arm
    where it is."""

    TIER: ClassVar[Tier] = "emulated only"
    Options = So101FollowerOptions
    USB: ClassVar[tuple[UsbId, ...]] = USB

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        """Boards that may lead to an arm."""
        return serial_ports(cls.USB)

    def __init__(self, options: So101FollowerOptions, tick_period: float) -> None:
        guardian = HoldingGuardian(LEASE_S + 2.0 * (1.0 / options.rate_hz + options.margin_s))

        def connect() -> SerialPort:
            path = options.port or only(self.plugged(), NAME, "slave.robot.port").path
            return SerialPort(path, options.baud, guardian)

        gravity = _model() if options.gravity else no_gravity
        super().__init__(
            _spec(options, gravity is not no_gravity),
            FollowerExchange(options, connect, gravity, guardian=guardian),
            rest=None,
            stale=max(STALE_S, 3.0 * tick_period),
            bad_replies=options.bad_replies,
            reconnect=options.reconnect_s,
        )

    def follow(self, angles: Joints, now: float) -> None:
        self._command(angles, angles, now)


def no_gravity(angles: Joints) -> Joints:
    return (0.0,) * len(angles)


def _model() -> Gravity:
    from weberlink_mujoco.arms.models import load  # noqa: PLC0415 - MuJoCo takes its time

    return load("so101").gravity


def _spec(options: So101FollowerOptions, modelled: bool) -> ArmSpec:
    share = CALIBRATED_ERROR if options.calibrated else LOAD_ERROR
    error = max(options.friction_nm) + (share if modelled else 1.0) * GRAVITY_NM
    source = "currents" if options.torque_per_amp_nm else "loads"
    by = "by a calibration" if options.calibrated else "not calibrated, by the data sheet"
    lag = 1e3 / (2.0 * pi * options.torque_cutoff_hz)
    weight = "" if modelled else "; the arm's own weight is not subtracted (needs `gravity: true`)"
    stall = tuple(FULL_LOAD * each for each in options.per_load)
    return ArmSpec(
        name=NAME,
        joints=JOINTS,
        gripper=True,
        lower=options.lower_rad,
        upper=options.upper_rad,
        torque_nm=stall,
        stiffness_nm_rad=options.stiffness,
        rate_hz=options.rate_hz,
        calibrated=options.calibrated,
        lag_s=1.0 / options.rate_hz + options.cycle_s(0),
        torque_error_nm=round(error, 2),
        watchdog_s=None,
        note=f"torques are estimated from {source}, {by}{weight}, and lag {lag:.0f} ms more than the angles; the "
        "servos have no watchdog, a guardian process lets them hold the arm where it is when this one stops",
    )


class FollowerExchange:
    """The work of the bus thread; a command is angles to go to [rad], None to stay.

    Args:
        options: Of the follower.
        connect: Opens the port, at every opening.
        gravity: Torque that holds the arm at given angles [N m].
        clock: Monotonic [s].
        pause: Sleeps [s].
        guardian: Of the port; None for none.
    """

    def __init__(
        self,
        options: So101FollowerOptions,
        connect: Callable[[], ServoPort],
        gravity: Gravity,
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
        guardian: HoldingGuardian | None = None,
    ) -> None:
        self._options = options
        self._connect = connect
        self._gravity = gravity
        self._guardian = guardian
        self._clock = clock
        self._pause = pause
        self._stiffness = options.stiffness
        self._weight: Joints = ()
        self._angles: Joints = ()
        self._goal: Joints = ()
        """What the servos were told last [rad]."""
        self._torques: Joints = ()
        self._measured_at = 0.0
        self._cycle = 0
        self._arm: So101Bus | None = None

    def open(self) -> ArmSample:
        options = self._options
        port = self._connect()
        try:
            arm = So101Bus(options, port, self._clock, self._pause)
            arm.servos.prepare(options.p_gain)
            arm.check_pace()
            present = arm.first()
            self._engage(arm, present)
        except BaseException:
            port.close()
            raise
        self._arm = arm
        self._torques = ()
        self._cycle = 0
        return self._sample(arm, present, self._clock())

    def _engage(self, arm: So101Bus, present: list[Present]) -> None:
        """Torque on, to stay where the arm is."""
        options, angles = self._options, arm.scale.angles(present)
        self._weight = self._gravity(angles)
        self._goal = self._raised(angles)
        orders = [
            (id_, registers.order(True, goal, limit))
            for id_, goal, limit in zip(options.ids, _counts(arm, self._goal), options.torque_limit, strict=True)
        ]
        self._hold(arm, self._goal)
        arm.bus.send(packet.sync_write(ORDER_ADDRESS, ORDER_SIZE, orders))

    def exchange(self, command: Joints | None) -> ArmSample:
        arm = self._arm
        assert arm is not None
        self._hold(arm, self._raised(self._angles))
        self._cycle += 1
        if self._cycle % WATCH_EVERY == 0:
            self._watch(arm, self._cycle // WATCH_EVERY % len(NAMES))
        orders = b""
        if command is not None:
            self._goal = self._raised(command)
            orders = self._orders(arm, self._goal)
        asked = self._clock()
        present = arm.bus.exchange(orders)
        return self._sample(arm, present, 0.5 * (asked + self._clock()))

    def _hold(self, arm: So101Bus, goals: Joints) -> None:
        """Let the guardian set these goals [rad] when this process stops."""
        if self._guardian is not None:
            self._guardian.hold(self._orders(arm, goals) * REPEATS)

    def _orders(self, arm: So101Bus, goals: Joints) -> bytes:
        """The request that sets these goals [rad]."""
        values = [
            (id_, GOAL_POSITION.encode(goal)) for id_, goal in zip(self._options.ids, _counts(arm, goals), strict=True)
        ]
        return packet.sync_write(GOAL_POSITION.address, GOAL_POSITION.size, values)

    def _raised(self, angles: Joints) -> Joints:
        """The goals for these angles, within the range of the arm [rad].

        Position control needs an error to push. The weight gets its share of it here, so that the arm does not sag, and
        an error of the angles is what it presses with.
        """
        options = self._options
        limits = zip(angles, options.lower_rad, options.upper_rad, self._weight, self._stiffness, strict=True)
        return tuple([min(max(angle, low), high) + weight / k for angle, low, high, weight, k in limits])

    def _watch(self, arm: So101Bus, axis: int) -> None:
        """Raise HardwareFault for a servo that lost its torque: what it measures does not show that."""
        id_ = self._options.ids[axis]
        if not arm.bus.read(id_, TORQUE_ENABLE):
            raise HardwareFault(f"{arm.bus.label(id_)}: its torque is off; was it without power?")

    def _sample(self, arm: So101Bus, present: list[Present], at: float) -> ArmSample:
        self._angles = angles = arm.scale.angles(present)
        self._weight = self._gravity(angles)
        external = self._external(arm, present)
        share = -expm1(-2.0 * pi * self._options.torque_cutoff_hz * max(0.0, at - self._measured_at))
        if self._torques:
            external = tuple([old + share * (new - old) for old, new in zip(self._torques, external, strict=True)])
        self._torques, self._measured_at = external, at
        zones = self._options.friction_nm
        return ArmSample(at, angles, tuple([_beyond(each, zone) for each, zone in zip(external, zones, strict=True)]))

    def _external(self, arm: So101Bus, present: list[Present]) -> Joints:
        options = self._options
        per_amp = options.torque_per_amp_nm
        if per_amp is None:
            motor = motor_torques(present, arm.scale.rates(present), options, options.per_load)
        else:
            motor = tuple(
                [
                    sign * copysign(unit * each.current * registers.A_PER_COUNT, each.load)
                    for each, sign, unit in zip(present, options.sign, per_amp, strict=True)
                ]
            )
        return tuple([weight - own for weight, own in zip(self._weight, motor, strict=True)])

    def close(self) -> None:
        """Leave the arm holding itself, or limp; any number of times."""
        arm, self._arm = self._arm, None
        if arm is None:
            return
        if self._options.on_close is OnClose.LIMP:
            arm.release()
        else:
            with suppress(HardwareFault):
                self._measure(arm)
                give_way(self._goal, self._raised(self._angles), lambda goals: self._settled(arm, goals))
        if self._guardian is not None:
            self._guardian.end()
        arm.close()

    def _settled(self, arm: So101Bus, goals: Joints) -> Joints:
        """Go to goals [rad], and give the place to which this leads."""
        arm.bus.send(self._orders(arm, goals))
        until = self._clock() + SETTLE_S
        while self._clock() < until:
            self._hold(arm, goals)
            self._pause(1.0 / self._options.rate_hz)
        self._measure(arm)
        return self._raised(self._angles)

    def _measure(self, arm: So101Bus) -> None:
        """Measure angles and weight; a servo with an error is asked too, and one that does not answer has not moved."""
        positions = arm.scale.counts(self._angles)
        for axis, id_ in enumerate(self._options.ids):
            with suppress(BadReply):
                positions[axis] = arm.bus.read(id_, POSITION)
        self._angles = arm.scale.angles_at(positions)
        self._weight = self._gravity(self._angles)


def _counts(arm: So101Bus, goals: Joints) -> list[int]:
    """Positions of the servos [counts]."""
    return [min(registers.COUNTS_PER_TURN - 1, max(0, goal)) for goal in arm.scale.counts(goals)]


def _beyond(torque: float, zone: float) -> float:
    """The part of a torque beyond a dead zone."""
    return copysign(max(0.0, abs(torque) - zone), torque)
