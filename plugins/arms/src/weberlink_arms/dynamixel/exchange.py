"""One cycle on the bus of Dynamixel motors: read all, and command torques of a leader or angles of a follower."""

from abc import abstractmethod
from collections.abc import Callable
from time import monotonic, sleep
from typing import Any, Final

from weberlink.geometry.joints import Joints
from weberlink.hardware.fault import BadReply
from weberlink_arms.dynamixel import registers
from weberlink_arms.dynamixel.bus import MotorBus, MotorReading, latency_advice
from weberlink_arms.dynamixel.motor_models import CurrentLaw, JointFriction
from weberlink_arms.dynamixel.motors import Motors
from weberlink_arms.dynamixel.options import DynamixelArmOptions
from weberlink_arms.servo.arm import ArmSample
from weberlink_arms.servo.exchange import WATCH_EVERY, Command, Gravity, Sample, ServoExchange, no_gravity
from weberlink_arms.servo.position import PositionControl

GRAVITY_RAMP_S: Final = 0.5  # in which a leader begins to carry its own weight


class MotorExchange(ServoExchange[Command, Sample]):
    """Of an arm with Dynamixel motors."""

    _misses = 0
    _signs: tuple[int, ...] = ()
    _laws: tuple[CurrentLaw, ...] = ()
    _ratios: Joints = ()

    def _made(self, bus: MotorBus) -> Motors:
        options, layout = self._options, self._options.LAYOUT
        self._signs, self._laws, self._ratios = options.signs, options.laws, options.ratios
        current = 1e-3 * options.max_current_ma
        return Motors(bus, options.watchdog_s, current, layout.motors, layout.title, reversible=True)

    def _prepare(self) -> None:
        self._servos.quicken()

    def _advice(self) -> str:
        path = self._servos.bus.path
        return latency_advice(path) or "set rate_hz lower, or use a higher baud, another adapter or another host"

    def exchange(self, command: Command) -> Sample:
        motors = self._servos
        self._cycle += 1
        if motors.slept(self._clock()):
            motors.watch_all()
        elif self._cycle % WATCH_EVERY == 0:
            motors.watch()
        asked = self._clock()
        try:
            present = motors.bus.present()
        except BadReply:
            self._misses += 1
            if self._misses > 1:
                self._rest()
            raise
        self._misses = 0
        now, angles = self._clock(), self._angles(present)
        self._act(command, present, angles, now)
        return self._sample(present, angles, 0.5 * (asked + now))

    def _rest(self) -> None:
        """Called from the second missing answer on."""

    @abstractmethod
    def _act(self, command: Command, present: list[MotorReading], angles: Joints, now: float) -> None:
        """Command the motors."""


class TorqueExchange(MotorExchange[Joints, ArmSample]):
    """A leader: its motors display torques [N m] under current control, and carry its weight if `gravity` is given."""

    _opened_at = 0.0
    _weight: Joints = ()

    def _engage(self, angles: Joints, now: float) -> None:
        self._opened_at, self._misses, self._weight = now, 0, (0.0,) * len(angles)
        self._servos.engage([0] * len(angles))

    def _act(self, command: Joints, present: list[MotorReading], angles: Joints, now: float) -> None:  # noqa: ARG002
        share = min(1.0, (now - self._opened_at) / GRAVITY_RAMP_S)
        self._weight = tuple([share * each for each in self._gravity(angles)])
        self._servos.command(self._counts(tuple([a + b for a, b in zip(command, self._weight, strict=True)])))

    def _rest(self) -> None:
        """The motors carry the weight only."""
        self._servos.command(self._counts(self._weight))

    def _counts(self, torques: Joints) -> list[int]:
        axes = zip(self._signs, self._options.LAYOUT.motors, torques, self._laws, self._ratios, strict=True)
        return [sign * model.counts(torque / ratio, law) for sign, model, torque, law, ratio in axes]

    def _sample(self, present: list[MotorReading], angles: Joints, at: float) -> ArmSample:  # noqa: ARG002
        return ArmSample(at, angles, (0.0,) * len(angles))

    def _leave(self) -> None:
        self._servos.release()


class PositionExchange(MotorExchange[Joints | None, ArmSample]):
    """A follower: its motors go to angles [rad] by their own position control; None holds the last goal."""

    def __init__(
        self,
        options: DynamixelArmOptions,
        connect: Callable[[], Any],
        gravity: Gravity = no_gravity,
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
    ) -> None:
        super().__init__(options, connect, gravity, clock, pause)
        given = self._options
        self.control = PositionControl(given.stiffness, given.dead_zone, given.torque_cutoff_hz)
        self._friction = JointFriction(given.coulomb, given.viscous)
        self._goal_at = 0.0

    def _engage(self, angles: Joints, now: float) -> None:
        self._servos.engage_positions(self._options.gains)
        self.control.restart(angles)
        self._goal_at = now

    def _act(self, command: Joints | None, present: list[MotorReading], angles: Joints, now: float) -> None:  # noqa: ARG002
        # After a pause a goal continues from where it was, so that the arm does not jump.
        way = self._options.speed_rad_s * min(now - self._goal_at, 2.0 / self._options.rate_hz)
        self._goal_at = now
        if self.control.sinks:
            self.control.sink(angles, now, 1.0 / self._options.rate_hz)
        elif command is not None:
            axes = zip(self.control.goal, self._options.within(command), strict=True)
            self.control.goal = tuple([goal + min(max(wanted - goal, -way), way) for goal, wanted in axes])
        self._go(self.control.goal)

    def _go(self, goals: Joints) -> None:
        self._servos.go(self._scale.counts(goals))

    def _sample(self, present: list[MotorReading], angles: Joints, at: float) -> ArmSample:
        motors, weight, torques = self._options.LAYOUT.motors, self._gravity(angles), []
        for axis, each in enumerate(present):
            sign = self._signs[axis]
            rate = sign * each.velocity * registers.RAD_S_PER_COUNT
            motor = sign * self._ratios[axis] * motors[axis].torque(each.current, self._laws[axis])
            torques.append(weight[axis] + self._friction.torque(axis, rate) - motor)
        return ArmSample(at, angles, self.control.sensed(tuple(torques), at))

    def _leave(self) -> None:
        if self._options.on_close == "limp" or self.control.lies:
            self._servos.release()
            return
        goals = self.control.leave(self._place, self._go, self._clock, lambda: self._pause(1.0 / self._options.rate_hz))
        self._servos.stay(None if goals is None else self._scale.counts(goals))

    def _place(self) -> Joints:
        angles = self._angles(self._servos.bus.present())
        return self.control.raised(angles, self._gravity(angles))
