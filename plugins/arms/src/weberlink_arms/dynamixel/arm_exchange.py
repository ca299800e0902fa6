"""One cycle on the bus of an arm: read all motors, and command the torques of a leader or the angles of a follower."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from math import expm1, pi
from time import monotonic, sleep
from typing import Final, Generic, TypeVar, cast

from weberlink.arms.threaded_arm import ArmSample
from weberlink.geometry.joints import Joints
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.pace import check_pace
from weberlink_arms.dynamixel import registers
from weberlink_arms.dynamixel.bus import MotorBus, MotorPort, MotorReading, latency_advice
from weberlink_arms.dynamixel.motors import Motors
from weberlink_arms.dynamixel.options import DynamixelArmOptions
from weberlink_arms.giving_way import SETTLE_S, give_way

Command = TypeVar("Command")
Gravity = Callable[[Joints], Joints]
"""Torques of all axes [N m] that hold the arm at these angles [rad]."""

WATCH_EVERY: Final = 25
"""Cycles between two checks of a motor's torque or watchdog."""
BEYOND_RAD: Final = 0.35
"""Largest angle of an axis beyond its range at opening; more means that its zero is wrong."""
GRAVITY_RAMP_S: Final = 0.5
"""Time in which a leader begins to carry its own weight [s]."""
FULL_RATE_RAD_S: Final = 0.05
"""Speed from which on dry friction has its full value [rad/s]."""


def no_gravity(angles: Joints) -> Joints:
    return (0.0,) * len(angles)


def model_gravity(name: str) -> Gravity:
    """By the model of this name."""
    return cast("Gravity", import_module("weberlink_mujoco.arms.models").load(name).gravity)


class ArmExchange(ABC, Generic[Command]):
    """The work of the bus thread.

    Args:
        options: Of the arm.
        connect: Opens the port, at every opening.
        current: Largest current ever commanded, in the unit of the registers [A].
        gravity: Of the arm.
        clock: Monotonic [s].
        pause: Sleeps [s].
    """

    def __init__(
        self,
        options: DynamixelArmOptions,
        connect: Callable[[], MotorPort],
        current: float,
        gravity: Gravity = no_gravity,
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
    ) -> None:
        self._options, self._layout = options, options.LAYOUT
        self._models, self._laws, self._signs = self._layout.motors, options.laws, options.signs
        self._ratios = options.ratios
        self._connect, self._current, self._gravity = connect, current, gravity
        self._clock, self._pause = clock, pause
        self._port: MotorPort | None = None
        self._motors: Motors | None = None
        self._engaged = False
        self._cycle = 0

    def open(self) -> ArmSample:
        self._port = self._connect()
        try:
            return self._begin(self._port)
        except BaseException:
            self.close()
            raise

    def _begin(self, port: MotorPort) -> ArmSample:
        options, layout = self._options, self._layout
        bus = MotorBus(
            port, options.baud, options.motor_ids, options.margin_s, self._clock, self._pause, names=layout.axes
        )
        motors = self._motors = Motors(
            bus, options.baud, options.watchdog_s, self._current, layout.motors, layout.title, reversible=True
        )
        motors.find()
        motors.quicken()
        check_pace(
            motors.first_present,
            self._options.rate_hz,
            self._clock,
            port.path,
            lambda: latency_advice(port.path) or "set rate_hz lower, or use a higher baud or another adapter",
        )
        now = self._clock()
        present = motors.first_present()
        angles = self._angles(present)
        self._check_zero(bus, angles)
        self._cycle = 0
        self._engaged = True  # from here on, `close` must make the motors safe
        self._engage(motors, angles, now)
        return self._sample(present, angles, now)

    def _check_zero(self, bus: MotorBus, angles: Joints) -> None:
        for id_, angle, low, high in zip(bus.ids, angles, self._options.lower, self._options.upper, strict=True):
            if not low - BEYOND_RAD <= angle <= high + BEYOND_RAD:
                raise HardwareFault(
                    f"{bus.label(id_)}: stands at {angle:.2f} rad, outside its range of {low:.2f} to {high:.2f}: "
                    "check its sign, offset_rad, lower_rad and upper_rad"
                )

    def exchange(self, command: Command) -> ArmSample:
        motors = self._motors
        assert motors is not None
        self._cycle += 1
        if motors.slept(self._clock()):
            motors.watch_all()
        elif self._cycle % WATCH_EVERY == 0:
            motors.watch()
        asked = self._clock()
        try:
            present = motors.present()
        except BadReply:
            self._missed(motors)
            raise
        now = self._clock()
        angles = self._angles(present)
        self._act(motors, command, angles, now)
        return self._sample(present, angles, 0.5 * (asked + now))

    def close(self) -> None:
        """Leave the arm safe; any number of times."""
        motors, self._motors = self._motors, None
        engaged, self._engaged = self._engaged, False
        if motors is not None and engaged:
            self._leave(motors)
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _angles(self, present: Sequence[MotorReading]) -> Joints:
        return self._options.angles([each.position for each in present])

    @abstractmethod
    def _engage(self, motors: Motors, angles: Joints, now: float) -> None:
        """Enable the motors without a motion."""

    @abstractmethod
    def _act(self, motors: Motors, command: Command, angles: Joints, now: float) -> None:
        """Command the motors."""

    @abstractmethod
    def _sample(self, present: Sequence[MotorReading], angles: Joints, at: float) -> ArmSample: ...

    def _missed(self, motors: Motors) -> None:
        """Called after a missing or bad answer."""

    @abstractmethod
    def _leave(self, motors: Motors) -> None:
        """Never raises."""


class TorqueExchange(ArmExchange[Joints]):
    """A leader: its motors display torques [N m] under current control, and carry its weight if `gravity` is given."""

    _opened_at = 0.0
    _misses = 0
    _weight: Joints = ()

    def _engage(self, motors: Motors, angles: Joints, now: float) -> None:
        self._opened_at, self._misses, self._weight = now, 0, (0.0,) * len(angles)
        motors.engage([0] * len(angles))

    def _act(self, motors: Motors, command: Joints, angles: Joints, now: float) -> None:
        self._misses = 0
        share = min(1.0, (now - self._opened_at) / GRAVITY_RAMP_S)
        self._weight = tuple([share * each for each in self._gravity(angles)])
        motors.command(self._counts(tuple([a + b for a, b in zip(command, self._weight, strict=True)])))

    def _missed(self, motors: Motors) -> None:
        """After the second miss, the motors carry the weight only."""
        self._misses += 1
        if self._misses > 1:
            motors.command(self._counts(self._weight))

    def _counts(self, torques: Joints) -> list[int]:
        return [
            sign * model.counts(torque / ratio, law)
            for sign, model, torque, law, ratio in zip(
                self._signs, self._models, torques, self._laws, self._ratios, strict=True
            )
        ]

    def _sample(self, present: Sequence[MotorReading], angles: Joints, at: float) -> ArmSample:  # noqa: ARG002
        return ArmSample(at, angles, (0.0,) * len(angles))

    def _leave(self, motors: Motors) -> None:
        motors.release()


class PositionExchange(ArmExchange[Joints | None]):
    """A follower: its motors go to angles [rad] by their own position control; None holds the last goal.

    At rest and in slow motion the motors carry weight, friction and the torque of the environment, so

        environment = weight + friction - motor,    motor = that of the current or load

    less a dead zone. The inertia of links and rotors is not subtracted.

    Args:
        dead_zone: Of each axis [N m].
        coulomb, viscous: Friction of each axis [N m], [N m s].
        speed: Largest of a goal [rad/s].
        cutoff: Of a low-pass on the torques [Hz]; 0 for none.
        gains: Position gains (register 84); None for those as delivered.
    """

    def __init__(
        self,
        options: DynamixelArmOptions,
        connect: Callable[[], MotorPort],
        current: float,
        gravity: Gravity = no_gravity,
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
        *,
        dead_zone: Joints,
        coulomb: Joints,
        viscous: Joints,
        speed: float,
        cutoff: float,
        gains: Sequence[int | None],
    ) -> None:
        super().__init__(options, connect, current, gravity, clock, pause)
        self._dead_zone, self._coulomb, self._viscous = dead_zone, coulomb, viscous
        self._speed, self._cutoff, self._gains = speed, 2.0 * pi * cutoff, tuple(gains)
        stiffness = [model.stiffness(gain) for model, gain in zip(self._models, self._gains, strict=True)]
        self._stiffness = tuple([ratio * each for ratio, each in zip(self._ratios, stiffness, strict=True)])
        self._goal: Joints = ()
        self._goal_at = 0.0
        self._torques: Joints = ()
        self._torques_at: float | None = None
        self.hold_on_close = True
        """Whether `close` leaves the motors holding the arm, or limp."""

    def _engage(self, motors: Motors, angles: Joints, now: float) -> None:
        motors.engage_positions(self._gains)
        self._goal, self._goal_at, self._torques_at = angles, now, None

    def _act(self, motors: Motors, command: Joints | None, angles: Joints, now: float) -> None:  # noqa: ARG002
        # After a pause a goal continues from where it was, so that the arm does not jump.
        way = self._speed * min(now - self._goal_at, 2.0 / self._options.rate_hz)
        self._goal_at = now
        if command is not None:
            limited = [
                min(max(wanted, low), high)
                for wanted, low, high in zip(command, self._options.lower, self._options.upper, strict=True)
            ]
            self._goal = tuple(
                [goal + min(max(wanted - goal, -way), way) for goal, wanted in zip(self._goal, limited, strict=True)]
            )
        motors.go(self._options.positions(self._goal))

    def _sample(self, present: Sequence[MotorReading], angles: Joints, at: float) -> ArmSample:
        weight, torques = self._gravity(angles), []
        for axis, each in enumerate(present):
            sign, model = self._signs[axis], self._models[axis]
            rate = sign * each.velocity * registers.RAD_S_PER_COUNT
            share = min(max(rate / FULL_RATE_RAD_S, -1.0), 1.0)
            friction = self._coulomb[axis] * share + self._viscous[axis] * rate
            motor = sign * self._ratios[axis] * model.torque(each.current, self._laws[axis])
            torques.append(weight[axis] + friction - motor)
        return ArmSample(at, angles, self._beyond_dead_zone(self._filtered(torques, at)))

    def _filtered(self, torques: list[float], at: float) -> Joints:
        share = 1.0
        if self._torques_at is not None and self._cutoff > 0.0:
            share = -expm1(-self._cutoff * max(0.0, at - self._torques_at))
        before = self._torques if self._torques_at is not None else torques
        self._torques = tuple([a + share * (b - a) for a, b in zip(before, torques, strict=True)])
        self._torques_at = at
        return self._torques

    def _beyond_dead_zone(self, torques: Joints) -> Joints:
        return tuple([each - min(max(each, -zone), zone) for each, zone in zip(torques, self._dead_zone, strict=True)])

    def _leave(self, motors: Motors) -> None:
        if not self.hold_on_close:
            motors.release()
            return
        goals: Joints | None = None
        with suppress(HardwareFault):
            here = self._place(motors.present())
            goals = give_way(self._goal, here, lambda goals: self._settled(motors, goals))
        motors.stay(None if goals is None else self._options.positions(goals))

    def _settled(self, motors: Motors, goals: Joints) -> Joints:
        """Go to goals [rad], and give the place to which this leads; the bus watchdogs hear of it all the time."""
        counts = self._options.positions(goals)
        until = self._clock() + SETTLE_S
        while self._clock() < until:
            motors.go(counts)
            self._pause(1.0 / self._options.rate_hz)
            present = motors.present()
        return self._place(present)

    def _place(self, present: Sequence[MotorReading]) -> Joints:
        """Goals at which the motors carry the weight by the model, and push on nothing [rad]."""
        angles = self._angles(present)
        weights = zip(angles, self._gravity(angles), self._stiffness, strict=True)
        return tuple([angle + weight / stiffness for angle, weight, stiffness in weights])
