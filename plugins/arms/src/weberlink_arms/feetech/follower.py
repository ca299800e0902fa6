"""The follower `so101_follower`: an SO-101 arm under the position control of its servos.

The torque of the environment is estimated from what the motors exert and what the weight of the arm takes:

    external = gravity - motor,    less the friction of the gears within which nothing can be told

A load is the duty of a motor's bridge, not a torque; 345:1 gears with friction lie between. So this is coarse, and in
newton metres by a calibration only.
"""

from collections.abc import Callable
from contextlib import suppress
from math import copysign, pi
from time import monotonic, sleep
from typing import Annotated, Any, Final

from pydantic import Field

from weberlink.arms.contract import ArmSpec
from weberlink.geometry.joints import Joints
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.guardian import Guardian
from weberlink_arms.feetech import registers
from weberlink_arms.feetech.arm import NO_LOAD_RAD_S, REPEATS, SO101, FeetechExchange, SixPositive, So101Options
from weberlink_arms.feetech.bus import USB
from weberlink_arms.feetech.packet import FRAMING
from weberlink_arms.feetech.registers import FULL_LOAD, GOAL_POSITION, ORDER_ADDRESS, ORDER_SIZE, POSITION, Present
from weberlink_arms.servo.arm import ArmSample, ServoFollower, spec_of
from weberlink_arms.servo.exchange import WATCH_EVERY, Gravity, gravity_of
from weberlink_arms.servo.layout import COUNTS_PER_TURN, RAD_PER_COUNT
from weberlink_arms.servo.position import OnClose, PositionControl

STALL_NM: Final = 1.91  # of the C001 (1/345) at 7.4 V, by the vendor: 19.5 kg cm; the C018 has 30 kg cm at 12 V
LEASE_S: Final = 0.1  # beyond two cycles, time without one after which the guardian takes this process for stopped
GRAVITY_NM: Final = 0.9  # largest torque of the arm's own weight, by its model stretched out from the shoulder
# Share of a torque by the data sheet, and by a calibration, that may be wrong; chosen, not measured.
LOAD_ERROR: Final = 0.3
CALIBRATED_ERROR: Final = 0.1

Limit = Annotated[int, Field(ge=50, le=1000)]
Friction = Annotated[float, Field(ge=0.0, le=5.0)]


class So101FollowerOptions(So101Options):
    """Options of `so101_follower`. Tuples: shoulder_pan, shoulder_lift, elbow_flex, wrist_flex, wrist_roll, gripper."""

    LAYOUT = SO101._replace(name="so101_follower")
    GOAL_SIZE = GOAL_POSITION.size

    p_gain: int = Field(default=16, ge=4, le=64, description="of the servos' position control; 16 as LeRobot sets it")
    torque_limit: tuple[Limit, Limit, Limit, Limit, Limit, Limit] = Field(
        default=(1000, 1000, 1000, 1000, 1000, 500), description="of the servos, in 0.1 % of their stall torque"
    )
    on_close: OnClose = Field(
        default=OnClose.HOLD,
        description="hold: the servos hold the arm where it is, and push no more; sink: it sinks slowly, then is limp; "
        "limp: it drops",
    )
    stall_nm: float = Field(
        default=STALL_NM, gt=0.0, le=10.0, description="stall torque of the servos at rated_v; 2.94 for 12 V servos"
    )
    torque_per_amp_nm: SixPositive | None = Field(
        default=None, description="torque of a current of 1 A, by a calibration; then the current counts, not the load"
    )
    gravity: bool = Field(default=True, description="carry the weight of the arm, and subtract it, by its model")
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


class HoldingGuardian(Guardian):
    """Lets an arm whose motors keep their last goals push no more when this process stops, and keep its place.

    Without torque the arm would drop, so there is no message that takes the torque off. Each cycle, within `lasts` [s]
    of the last one, the exchange says what leaves the arm where it is.
    """

    def __init__(self, lasts: float) -> None:
        super().__init__(b"")
        self._lasts = lasts
        self.given(0.0, lasts)

    def hold(self, message: bytes) -> None:
        """Set what leaves the arm safe from now on, and that this process is at work; raises HardwareFault if the
        guardian is dead or silent.
        """
        self.keep(message)
        self.lease(monotonic() + self._lasts)
        self.check_heard()

    def end(self) -> None:
        """The arm is safe as it is."""
        self.keep(b"")
        self.lease(0.0)

    def before(self, data: bytes) -> None:
        """A message of the exchange is written in any case: the last ones leave the arm safe."""

    def after(self, data: bytes) -> None:
        """See `before`."""


class So101Follower(ServoFollower):
    """An SO-101 follower arm. Its servos have no watchdog: when this process stops, a guardian lets them hold the arm
    where it is."""

    Options = So101FollowerOptions
    USB = USB

    def __init__(self, options: So101FollowerOptions, tick_period: float) -> None:
        guardian = HoldingGuardian(LEASE_S + 2.0 * (1.0 / options.rate_hz + options.margin_s))
        gravity = gravity_of(SO101.name, options.gravity)
        connect = self.port(options, options.LAYOUT.name, guardian)
        exchange = FollowerExchange(options, connect, gravity, guardian=guardian)
        super().__init__(options, _spec(options), exchange, tick_period)


def _spec(options: So101FollowerOptions) -> ArmSpec:
    share = CALIBRATED_ERROR if options.calibrated else LOAD_ERROR
    error = max(options.friction_nm) + (share if options.gravity else 1.0) * GRAVITY_NM
    source = "currents" if options.torque_per_amp_nm else "loads"
    by = "by a calibration" if options.calibrated else "not calibrated, by the data sheet"
    lag = 1e3 / (2.0 * pi * options.torque_cutoff_hz)
    weight = "" if options.gravity else "; the arm's own weight is not subtracted (gravity: false)"
    return spec_of(
        options,
        torque_nm=tuple(FULL_LOAD * each for each in options.per_load),
        stiffness_nm_rad=options.stiffness,
        calibrated=options.calibrated,
        torque_error_nm=round(error, 2),
        watchdog_s=None,
        note=f"torques are estimated from {source}, {by}{weight}, and lag {lag:.0f} ms more than the angles; the "
        "servos have no watchdog, a guardian process lets them hold the arm where it is when this one stops",
    )


class FollowerExchange(FeetechExchange[Joints | None, ArmSample]):
    """The work of the bus thread; a command is angles to go to [rad], None to stay."""

    def __init__(
        self,
        options: So101FollowerOptions,
        connect: Callable[[], Any],
        gravity: Gravity,
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
        guardian: HoldingGuardian | None = None,
    ) -> None:
        super().__init__(options, connect, gravity, clock, pause)
        self._guardian = guardian
        self.control = PositionControl(options.stiffness, options.friction_nm, options.torque_cutoff_hz)
        self._weight: Joints = ()
        self._here: Joints = ()

    def _engage(self, angles: Joints, now: float) -> None:  # noqa: ARG002
        """Torque on, to stay where the arm is."""
        self._here, self._weight = angles, self._gravity(angles)
        goals = self._raised(angles)
        self.control.restart(goals)
        self._hold(goals)
        bus = self._servos.bus
        axes = zip(bus.ids, self._counts(goals), self._options.torque_limit, strict=True)
        orders = [(id_, registers.order(True, goal, limit)) for id_, goal, limit in axes]
        bus.send(FRAMING.sync_write(ORDER_ADDRESS, ORDER_SIZE, orders))

    def exchange(self, command: Joints | None) -> ArmSample:
        self._hold(self._raised(self._here))
        self._cycle += 1
        if self._cycle % WATCH_EVERY == 0:
            self._servos.watch()
        orders = b""
        if self.control.sinks:
            self.control.sink(self._here, self._clock(), 1.0 / self._options.rate_hz)
        elif command is not None:
            self.control.goal = self._raised(command)
        if self.control.sinks or command is not None:
            orders = self._orders(self.control.goal)
        asked = self._clock()
        present = self._servos.bus.present(orders)
        return self._sample(present, self._angles(present), 0.5 * (asked + self._clock()))

    def _hold(self, goals: Joints) -> None:
        """Let the guardian set these goals [rad] when this process stops."""
        if self._guardian is not None:
            self._guardian.hold(self._orders(goals) * REPEATS)

    def _orders(self, goals: Joints) -> bytes:
        """The request that sets these goals [rad]."""
        axes = zip(self._servos.bus.ids, self._counts(goals), strict=True)
        values = [(id_, GOAL_POSITION.encode(goal)) for id_, goal in axes]
        return FRAMING.sync_write(GOAL_POSITION.address, GOAL_POSITION.size, values)

    def _counts(self, goals: Joints) -> list[int]:
        """Positions of the servos, on their turn [counts]."""
        return [min(COUNTS_PER_TURN - 1, max(0, goal)) for goal in self._scale.counts(goals)]

    def _raised(self, angles: Joints) -> Joints:
        """The goals for these angles, within the range of the arm [rad]: it does not sag."""
        return self.control.raised(self._options.within(angles), self._weight)

    def _sample(self, present: list[Present], angles: Joints, at: float) -> ArmSample:
        self._here, self._weight = angles, self._gravity(angles)
        motor = self._motor(present)
        external = tuple([weight - own for weight, own in zip(self._weight, motor, strict=True)])
        return ArmSample(at, angles, self.control.sensed(external, at))

    def _motor(self, present: list[Present]) -> Joints:
        """Torques of the motors on the axes [N m], by their currents, or the duty of their bridges and their speed.

        At a speed w, a motor with the duty d at a supply U has the torque stall * (d U / U0 - w / w0), with the stall
        torque and the speed w0 without load at the rated supply U0.
        """
        options = self._options
        if options.torque_per_amp_nm is not None:
            axes = zip(present, options.signs, options.torque_per_amp_nm, strict=True)
            unit = registers.A_PER_COUNT
            return tuple([sign * copysign(per_amp * each.current * unit, each.load) for each, sign, per_amp in axes])
        torques = []
        for each, sign, unit in zip(present, options.signs, options.per_load, strict=True):
            supply = each.voltage * registers.V_PER_COUNT / options.rated_v
            rate = sign * each.velocity * RAD_PER_COUNT
            torques.append(unit * (sign * each.load * supply - FULL_LOAD * rate / NO_LOAD_RAD_S))
        return tuple(torques)

    def _leave(self) -> None:
        """Leave the arm holding itself, or limp."""
        if self._options.on_close is OnClose.LIMP or self.control.lies:
            self._servos.release()
        else:
            self.control.leave(self._place, self._go, self._clock, lambda: self._pause(1.0 / self._options.rate_hz))
        if self._guardian is not None:
            self._guardian.end()

    def _go(self, goals: Joints) -> None:
        with suppress(HardwareFault):  # without its guardian the arm is left as with it
            self._hold(goals)
        self._servos.bus.send(self._orders(goals))

    def _place(self) -> Joints:
        """Measured one by one: a servo with an error is asked too, and one that does not answer has not moved."""
        counts = self._scale.counts(self._here)
        for axis, id_ in enumerate(self._servos.bus.ids):
            with suppress(BadReply):
                counts[axis] = self._servos.bus.read(id_, POSITION)
        self._here = self._scale.angles(counts)
        self._weight = self._gravity(self._here)
        return self.control.raised(self._here, self._weight)
