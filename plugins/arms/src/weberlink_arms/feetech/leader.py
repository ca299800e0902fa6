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
from typing import Any, Final

from pydantic import Field

from weberlink.arms.contract import ArmSpec
from weberlink.geometry.joints import Joints
from weberlink.hardware.guardian import Guardian
from weberlink_arms.feetech import registers
from weberlink_arms.feetech.arm import REPEATS, SO101, FeetechExchange, Six, So101Options
from weberlink_arms.feetech.bus import USB, FeetechBus, FeetechServos, torque_off
from weberlink_arms.feetech.packet import FRAMING
from weberlink_arms.feetech.registers import DUTY_PER_P_RAD, FULL_LOAD, ORDER_ADDRESS, ORDER_SIZE, Present
from weberlink_arms.servo.arm import ArmSample, ServoLeader, spec_of
from weberlink_arms.servo.layout import COUNTS_PER_TURN, RAD_PER_COUNT

STALL_NM: Final[Six] = (2.16, 1.91, 2.16, 1.37, 1.37, 1.37)
"""At 7.4 V, by the vendor: C044 (1/191, 22 kg cm), C001 (1/345, 19.5 kg cm), C044, and three C046 (1/147, 14 kg cm)."""
LEAST_V: Final = 4.0  # least supply that the orders make up for; a servo reports an error below that
RELEASE: Final = 0.5  # share of the dead zone below which a torque that was displayed ends


class So101LeaderOptions(So101Options):
    """Options of `so101_leader`. Tuples: shoulder_pan, shoulder_lift, elbow_flex, wrist_flex, wrist_roll, gripper."""

    LAYOUT = SO101._replace(name="so101_leader")

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


class So101Leader(ServoLeader):
    """An SO-101 leader arm. Its servos have no watchdog: when this process stops, a guardian takes the torque off."""

    Options = So101LeaderOptions
    USB = USB

    def __init__(self, options: So101LeaderOptions, tick_period: float) -> None:
        guardian = Guardian(b"")
        exchange = LeaderExchange(options, self.port(options, options.LAYOUT.name, guardian), guardian)
        super().__init__(options, _spec(options), exchange, tick_period)


def _spec(options: So101LeaderOptions) -> ArmSpec:
    calibrated = options.torque_per_load_nm is not None
    source = (
        "torques are by the calibration of torque_per_load_nm"
        if calibrated
        else "torques are not calibrated: shares of the stall torque in the data sheet, felt as a displacement; see "
        "docs/arms/so101.md to calibrate them with weights"
    )
    return spec_of(
        options,
        torque_nm=options.most,
        stiffness_nm_rad=options.stiffness,
        calibrated=calibrated,
        watchdog_s=None,
        note=f"{source}; the servos have no watchdog, a guardian process takes their torque off",
    )


class LeaderExchange(FeetechExchange[Joints, ArmSample]):
    """The work of the bus thread; a command is the torques to display [N m], within those of the options."""

    def __init__(
        self,
        options: So101LeaderOptions,
        connect: Callable[[], Any],
        guardian: Guardian,
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
    ) -> None:
        super().__init__(options, connect, clock=clock, pause=pause)
        self.guardian: Guardian | None = guardian
        self._ids = options.bus_ids
        self._off = torque_off(self._ids)
        guardian.zero = self._off * REPEATS
        # No single servo ever gets an order with torque, and the request for measurements alone follows no torque.
        alone = (bytes((0xFF, 0xFF, id_)) for id_ in self._ids)
        guardian.rests = (self._off, FRAMING.sync_read(0, 0, self._ids)[:5], *alone)
        self._per_load, self._stiffness = options.per_load, options.stiffness
        self._zone = tuple(options.dead_zone * most for most in options.most)
        self._pushing = [False] * 6
        self._present: list[Present] = []

    def _made(self, bus: FeetechBus) -> FeetechServos:
        bus.send(self._off)
        return super()._made(bus)

    def _engage(self, angles: Joints, now: float) -> None:  # noqa: ARG002 - torque is on only while it is displayed
        self._pushing = [False] * 6

    def exchange(self, command: Joints) -> ArmSample:
        orders = self._orders(command)
        asked = self._clock()
        present = self._servos.bus.present(orders)
        return self._sample(present, self._angles(present), 0.5 * (asked + self._clock()))

    def _orders(self, torques: Joints) -> bytes:
        """Requests that display these torques [N m]."""
        on: list[tuple[int, bytes]] = []
        off: list[int] = []
        for axis, (id_, torque) in enumerate(zip(self._ids, torques, strict=True)):
            least = self._zone[axis] * (RELEASE if self._pushing[axis] else 1.0)
            self._pushing[axis] = abs(torque) > least
            if self._pushing[axis]:
                on.append((id_, self._order(axis, torque)))
            else:
                off.append(id_)
        # Orders with torque come first: by its first bytes, the guardian tells a message with torque from one without.
        return (FRAMING.sync_write(ORDER_ADDRESS, ORDER_SIZE, on) if on else b"") + torque_off(tuple(off))

    def _order(self, axis: int, torque: float) -> bytes:
        present = self._present[axis]
        torque *= self._options.rated_v / max(present.voltage * registers.V_PER_COUNT, LEAST_V)
        ahead = torque / self._stiffness[axis] / RAD_PER_COUNT * self._options.signs[axis]
        # Two counts more, since the servo has a dead zone of one.
        goal = present.position + round(ahead + copysign(2.0, ahead))
        goal = min(COUNTS_PER_TURN - 1, max(0, goal))
        options, limit = self._options, round(abs(torque) / self._per_load[axis])
        limit = min(options.torque_limit, max(options.least_limit, limit))
        return registers.order(True, goal, limit)

    def _sample(self, present: list[Present], angles: Joints, at: float) -> ArmSample:
        self._present = present
        return ArmSample(at, angles, (0.0,) * 6)

    def _leave(self) -> None:
        self._servos.release()
