"""One cycle of the arm: read all joints, work out what holds the tip at its goal, command the currents.

Runs in a thread of its own at the rate of the bus. Owns what is put together there: bus, motors, impedance, estimate of
the force. Knows no tick; what it measures goes into an interpolation that the tick reads.
"""

from collections.abc import Callable
from contextlib import suppress
from time import monotonic, sleep
from typing import Final, NamedTuple

from weberlink.geometry.vector import Vector
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.slave.robots.dynamixel import registers
from weberlink.slave.robots.dynamixel.adapter import latency_advice
from weberlink.slave.robots.dynamixel.arm import LOWER, UPPER, Joints, Posture, posture
from weberlink.slave.robots.dynamixel.bus import Bus, Port, Present
from weberlink.slave.robots.dynamixel.external_force import Friction, LowPass, tip_force
from weberlink.slave.robots.dynamixel.goal import Goal
from weberlink.slave.robots.dynamixel.impedance import Gains, currents, joint_torques
from weberlink.slave.robots.dynamixel.motors import Motors
from weberlink.slave.robots.interpolation import Interpolation, Sample

WATCH_EVERY: Final = 25
"""Cycles from one look at a motor's torque or watchdog to the next."""
BEYOND_RAD: Final = 0.35
"""As far beyond its limits as a joint may be found; more means that its zero is not where it belongs."""
WEIGHT_A: Final = 0.65
"""That a motor needs to carry the arm stretched out: 1.06 N m, by the smallest published torque constant 1.65 N m/A."""
PACE_TRIES: Final = 40


class Settings(NamedTuple):
    """Of the cycle.

    Args:
        baud: of the bus [bit/s].
        ids: of the motors, joints 1 to 4.
        rate: of the cycle [Hz].
        margin: of an answer's deadline [s].
        watchdog: how long a motor goes on that hears nothing [s].
        gains: of the impedance.
        pitch: for the gripper [rad]; None for the one it has at opening.
        torque_constant: of the motors [N m/A].
        current: largest one commanded [A].
        friction: of the joints, for the estimate of the force.
        cutoff: of the low-pass on that estimate [Hz].
        approach_speed: to a command after opening or a pause [m/s].
        patience: how long the last command holds when no more come [s].
    """

    baud: int
    ids: tuple[int, int, int, int]
    rate: float
    margin: float
    watchdog: float
    gains: Gains
    pitch: float | None
    torque_constant: float
    current: float
    friction: Friction
    cutoff: float
    approach_speed: float
    patience: float


class ArmSample(NamedTuple):
    """Measured at `at` [s]: tip [m], force of the environment on it [N], joints [rad]."""

    at: float
    tip: Vector
    force: Vector
    joints: Joints


class ArmExchange:
    """What the thread does; a command is where the tip should go [m], None to stay.

    Args:
        settings: of the cycle.
        connect: opens the port, anew at every opening.
        interpolation: takes (x, y, z, fx, fy, fz) of every cycle.
        clock: monotonic [s].
        pause: lets time pass [s].
    """

    def __init__(
        self,
        settings: Settings,
        connect: Callable[[], Port],
        interpolation: Interpolation,
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
    ) -> None:
        self._settings = settings
        self._connect = connect
        self._interpolation = interpolation
        self._clock = clock
        self._pause = pause
        self._goal = Goal(settings.approach_speed, settings.patience)
        self._filter = LowPass(settings.cutoff)
        self._pitch = 0.0
        self._cycle = 0
        self._missed = 0
        self._weight: Joints = (0.0, 0.0, 0.0, 0.0)
        self._port: Port | None = None
        self._motors: Motors | None = None
        self._engaged = False
        self.hold_on_close = True
        """Whether `close` leaves the motors holding the arm where it is, or limp."""

    def open(self) -> ArmSample:
        self._port = self._connect()
        try:
            return self._begin(self._port)
        except BaseException:
            self.close()
            raise

    def _begin(self, port: Port) -> ArmSample:
        settings = self._settings
        bus = Bus(port, settings.baud, settings.ids, settings.margin, self._clock, self._pause)
        motors = self._motors = Motors(bus, settings.baud, settings.watchdog, settings.current)
        motors.find()
        if motors.current_limit < registers.counts_of_current(WEIGHT_A):
            raise HardwareFault(
                f"current limit (register 38) of {motors.current_limit} is too low to carry the arm; "
                f"set it to {registers.counts_of_current(settings.current)}"
            )
        self._check_pace(motors, port.path)
        now = self._clock()
        present = motors.first_present()
        self._check_zero(bus, present)
        arm = posture(_joints(present))
        self._weight = arm.gravity
        self._engaged = True  # from here on there is something to leave safe
        motors.engage(self._counts(self._weight))
        self._pitch = arm.pitch if settings.pitch is None else settings.pitch
        self._goal.place(arm.tip, now)
        self._filter.restart()
        self._cycle = self._missed = 0
        sample = self._sample(arm, present, now)
        self._interpolation.restart(_flat(sample))
        return sample

    def _check_pace(self, motors: Motors, path: str) -> None:
        """The best of many readings: a host that is busy for a moment must not look like a slow adapter."""
        period, best = 1.0 / self._settings.rate, 1.0
        for _ in range(PACE_TRIES):
            began = self._clock()
            motors.first_present()
            best = min(best, self._clock() - began)
            if best <= period:
                return
        advice = latency_advice(path) or "use a higher baud, or an adapter or a host that is not so slow"
        raise HardwareFault(
            f"{path}: a reading takes {best * 1e3:.1f} ms at best, {self._settings.rate:g} Hz leave "
            f"{period * 1e3:.1f} ms; {advice}"
        )

    @staticmethod
    def _check_zero(bus: Bus, present: list[Present]) -> None:
        for id_, angle, low, high in zip(bus.ids, _joints(present), LOWER, UPPER, strict=True):
            if not low - BEYOND_RAD <= angle <= high + BEYOND_RAD:
                raise HardwareFault(
                    f"{bus.label(id_)}: stands at {angle:.2f} rad, where it cannot be ({low:.2f} to {high:.2f}): "
                    "check its zero, and that ids are in the order of the joints"
                )

    def exchange(self, command: Vector | None) -> ArmSample:
        motors = self._motors
        assert motors is not None
        settings = self._settings
        self._cycle += 1
        began = self._clock()
        if motors.slept(began):
            motors.watch_all()
        elif self._cycle % WATCH_EVERY == 0:
            motors.watch()
        asked = self._clock()
        try:
            present = motors.present()
        except BadReply:
            self._missed += 1
            if self._missed > 1:  # once, the motors go on as they were; then they carry the weight and press no more
                motors.command(self._counts(self._weight))
            raise
        self._missed = 0
        now = self._clock()
        arm = posture(_joints(present))
        goal = self._goal.next(command, arm.tip, now)
        torques = joint_torques(arm, _rates(present), goal, self._pitch, settings.gains)
        motors.command(self._counts(torques))
        self._weight = arm.gravity
        sample = self._sample(arm, present, 0.5 * (asked + now))
        self._interpolation.add(_flat(sample))
        return sample

    def _counts(self, torques: Joints) -> tuple[int, ...]:
        amperes = currents(torques, self._settings.torque_constant, self._settings.current)
        return tuple([registers.counts_of_current(each) for each in amperes])

    def _sample(self, arm: Posture, present: list[Present], at: float) -> ArmSample:
        per_count = self._settings.torque_constant * registers.A_PER_COUNT
        a, b, c, d = present
        torques = (a.current * per_count, b.current * per_count, c.current * per_count, d.current * per_count)
        force = tip_force(arm, _rates(present), torques, self._settings.friction)
        return ArmSample(at, arm.tip, self._filter.next(force, at), arm.joints)

    def close(self) -> None:
        """Leave the arm holding itself, or limp, if it was under way; any number of times."""
        motors, self._motors = self._motors, None
        engaged, self._engaged = self._engaged, False
        if motors is not None and engaged:
            with suppress(HardwareFault):
                motors.command(self._counts(self._weight))  # what pressed, presses no more
            motors.leave(self.hold_on_close)
        port, self._port = self._port, None
        if port is not None:
            port.close()


def _joints(present: list[Present]) -> Joints:
    a, b, c, d = present
    angle = registers.angle
    return (angle(a.position), angle(b.position), angle(c.position), angle(d.position))


def _rates(present: list[Present]) -> Joints:
    a, b, c, d = present
    unit = registers.RAD_S_PER_COUNT
    return (a.velocity * unit, b.velocity * unit, c.velocity * unit, d.velocity * unit)


def _flat(sample: ArmSample) -> Sample:
    return Sample(sample.at, (*sample.tip, *sample.force))
