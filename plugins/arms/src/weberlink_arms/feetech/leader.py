"""The leader `so101_leader`: an SO-101 leader arm, whose servos display torque as a one-sided wall.

An STS3215 has no current mode. A torque is displayed by soft position control: the goal lies ahead of the measured
angle, in the direction of the torque, by

    torque / (P gain * duty per gain and angle * stall torque)

and the torque limit of the servo bounds it as well. So the motor pushes in that direction only. Its torque is on only
while a torque is displayed; at all other times the hand moves the unpowered arm.
"""

from collections.abc import Callable
from math import copysign
from time import monotonic, sleep
from typing import ClassVar, Final

from pydantic import Field

from weberlink.arms.contract import ArmSpec
from weberlink.arms.threaded_arm import ArmSample, ThreadedArm
from weberlink.geometry.joints import Joints
from weberlink.hardware.discovery import PluggedDevice, UsbId, only, serial_ports
from weberlink.hardware.guardian import Guardian
from weberlink.hardware.serial_port import SerialPort
from weberlink.registry import Tier
from weberlink_arms.feetech import packet, registers
from weberlink_arms.feetech.arm import JOINTS, NAMES, Six, So101Options
from weberlink_arms.feetech.bus import USB, ServoPort
from weberlink_arms.feetech.exchange import So101Bus
from weberlink_arms.feetech.registers import (
    DUTY_PER_P_RAD,
    FULL_LOAD,
    ORDER_ADDRESS,
    ORDER_SIZE,
    RAD_PER_COUNT,
    Present,
)
from weberlink_arms.feetech.servos import torque_off

NAME: Final = "so101_leader"
STALL_NM: Final[Six] = (2.16, 1.91, 2.16, 1.37, 1.37, 1.37)
"""At 7.4 V, by the vendor: C044 (1/191, 22 kg cm), C001 (1/345, 19.5 kg cm), C044, and three C046 (1/147, 14 kg cm)."""
LEAST_V: Final = 4.0
"""Least supply that the orders make up for [V]; a servo reports an error below that."""
STALE_S: Final = 0.02
REPEATS: Final = 6
"""Requests in the guardian's message; together longer than a message that it may cut, so that one arrives whole."""
RELEASE: Final = 0.5
"""Share of the dead zone below which a torque that was displayed ends."""


class So101LeaderOptions(So101Options):
    """Options of `so101_leader`. Tuples: shoulder_pan, shoulder_lift, elbow_flex, wrist_flex, wrist_roll, gripper."""

    p_gain: int = Field(default=16, ge=8, le=32, description="of the servos while torque is displayed; lower is softer")
    torque_limit: int = Field(
        default=250, ge=30, le=250, description="largest torque limit of a servo, in 0.1 % of its stall torque"
    )
    least_limit: int = Field(
        default=30, ge=1, le=250, description="smallest torque limit; less does not overcome the friction of the gears"
    )
    dead_zone: float = Field(
        default=0.05, ge=0.0, lt=1.0, description="share of the largest torque below which the torque stays off"
    )

    @property
    def per_load(self) -> Joints:
        """Torque of a load of 0.1 % [N m]."""
        return self.torque_per_load_nm or tuple(stall / FULL_LOAD for stall in STALL_NM)

    @property
    def most(self) -> Joints:
        """Largest torques displayed [N m]."""
        return tuple(self.torque_limit * each for each in self.per_load)

    @property
    def stiffness(self) -> Joints:
        """Of the soft position control [N m/rad]."""
        return tuple(self.p_gain * DUTY_PER_P_RAD * FULL_LOAD * each for each in self.per_load)


class So101Leader(ThreadedArm[Joints]):
    """An SO-101 leader arm. Its servos have no watchdog: when this process stops, a guardian takes the torque off."""

    TIER: ClassVar[Tier] = "emulated only"
    Options = So101LeaderOptions
    USB: ClassVar[tuple[UsbId, ...]] = USB

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        """Boards that may lead to an arm."""
        return serial_ports(cls.USB)

    def __init__(self, options: So101LeaderOptions, tick_period: float) -> None:
        self._most = options.most
        guardian = Guardian(b"")

        def connect() -> SerialPort:
            path = options.port or only(self.plugged(), NAME, "master.device.port").path
            return SerialPort(path, options.baud, guardian)

        super().__init__(
            _spec(options),
            LeaderExchange(options, connect, guardian),
            rest=(0.0,) * 6,
            stale=max(STALE_S, 3.0 * tick_period),
            bad_replies=options.bad_replies,
            reconnect=options.reconnect_s,
            scale=_scaled,
        )

    def display(self, torques: Joints, now: float) -> None:
        limited = tuple([min(max(torque, -most), most) for torque, most in zip(torques, self._most, strict=False)])
        self._command(limited, torques, now)


def _scaled(torques: Joints, share: float) -> Joints:
    return tuple([share * torque for torque in torques])


def _spec(options: So101LeaderOptions) -> ArmSpec:
    calibrated = options.torque_per_load_nm is not None
    source = (
        "torques are by the calibration of torque_per_load_nm"
        if calibrated
        else "torques are not calibrated: shares of the stall torque in the data sheet, felt as a displacement; see "
        "docs/arms/so101.md to calibrate them with weights"
    )
    return ArmSpec(
        name=NAME,
        joints=JOINTS,
        gripper=True,
        lower=options.lower_rad,
        upper=options.upper_rad,
        torque_nm=options.most,
        stiffness_nm_rad=options.stiffness,
        rate_hz=options.rate_hz,
        calibrated=calibrated,
        lag_s=1.0 / options.rate_hz + options.cycle_s(0),
        watchdog_s=None,
        note=f"{source}; the servos have no watchdog, a guardian process takes their torque off",
    )


class LeaderExchange:
    """The work of the bus thread; a command is the torques to display [N m], within those of the options.

    Args:
        options: Of the leader.
        connect: Opens the port, at every opening.
        guardian: Of the port.
        clock: Monotonic [s].
        pause: Sleeps [s].
    """

    def __init__(
        self,
        options: So101LeaderOptions,
        connect: Callable[[], ServoPort],
        guardian: Guardian,
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
    ) -> None:
        self._options = options
        self._connect = connect
        self.guardian: Guardian | None = guardian
        self._clock = clock
        self._pause = pause
        self._off = torque_off(options.ids)
        guardian.zero = self._off * REPEATS
        # No single servo ever gets an order with torque, and the request for measurements alone follows no torque.
        alone = (bytes((0xFF, 0xFF, id_)) for id_ in options.ids)
        guardian.rests = (self._off, packet.sync_read(0, 0, options.ids)[:5], *alone)
        self._per_load, self._stiffness = options.per_load, options.stiffness
        self._zone = tuple(options.dead_zone * most for most in options.most)
        self._pushing = [False] * 6
        self._present: list[Present] = []
        self._arm: So101Bus | None = None

    def open(self) -> ArmSample:
        port = self._connect()
        try:
            port.write(self._off)
            arm = So101Bus(self._options, port, self._clock, self._pause)
            arm.servos.prepare(self._options.p_gain)
            arm.check_pace()
        except BaseException:
            port.close()
            raise
        self._arm = arm
        self._pushing = [False] * 6
        return self._sample(arm, arm.first(), self._clock())

    def exchange(self, command: Joints) -> ArmSample:
        arm = self._arm
        assert arm is not None
        orders = self._orders(command)
        asked = self._clock()
        present = arm.bus.exchange(orders)
        return self._sample(arm, present, 0.5 * (asked + self._clock()))

    def _orders(self, torques: Joints) -> bytes:
        """Requests that display these torques [N m]."""
        ids, on, off = self._options.ids, [], []
        for axis, (id_, torque) in enumerate(zip(ids, torques, strict=True)):
            least = self._zone[axis] * (RELEASE if self._pushing[axis] else 1.0)
            self._pushing[axis] = abs(torque) > least
            if self._pushing[axis]:
                on.append((id_, self._order(axis, torque)))
            else:
                off.append(id_)
        # Orders with torque come first: by its first bytes, the guardian tells a message with torque from one without.
        return (packet.sync_write(ORDER_ADDRESS, ORDER_SIZE, on) if on else b"") + torque_off(tuple(off))

    def _order(self, axis: int, torque: float) -> bytes:
        present = self._present[axis]
        torque *= self._options.rated_v / max(present.voltage * registers.V_PER_COUNT, LEAST_V)
        ahead = torque / self._stiffness[axis] / RAD_PER_COUNT * self._options.sign[axis]
        # Two counts more, since the servo has a dead zone of one.
        goal = present.position + round(ahead + copysign(2.0, ahead))
        goal = min(registers.COUNTS_PER_TURN - 1, max(0, goal))
        options, limit = self._options, round(abs(torque) / self._per_load[axis])
        limit = min(options.torque_limit, max(options.least_limit, limit))
        return registers.order(True, goal, limit)

    def _sample(self, arm: So101Bus, present: list[Present], at: float) -> ArmSample:
        self._present = present
        return ArmSample(at, arm.scale.angles(present), (0.0,) * len(NAMES))

    def close(self) -> None:
        """Take the torque off, and set the servos back; any number of times."""
        arm, self._arm = self._arm, None
        if arm is None:
            return
        arm.release()
        arm.close()
