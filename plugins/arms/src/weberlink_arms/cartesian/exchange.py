"""One control cycle of the arm: read all joints, compute impedance and force estimate, command the currents."""

from collections.abc import Callable
from contextlib import suppress
from time import monotonic, sleep
from typing import Final, NamedTuple

from weberlink.arms.interpolation import Interpolation, TimedValues
from weberlink.geometry.vector import Vector
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.pace import check_pace
from weberlink_arms.cartesian.arm import LOWER, UPPER, ArmPose, Joints, Mechanics
from weberlink_arms.cartesian.external_force import ForceLowPass, tip_force
from weberlink_arms.cartesian.impedance import TipGoal, currents, joint_torques
from weberlink_arms.cartesian.options import DynamixelOptions
from weberlink_arms.dynamixel import registers
from weberlink_arms.dynamixel.bus import MotorBus, MotorPort, MotorReading, latency_advice
from weberlink_arms.dynamixel.motor_models import XM430_W350
from weberlink_arms.dynamixel.motors import Motors

PATIENCE_S: Final = 0.1
"""How long the last command holds when no more come [s]."""
WATCH_EVERY: Final = 25
"""Cycles between two checks of a motor's torque or watchdog."""
BEYOND_RAD: Final = 0.35
"""Largest angle of a joint beyond its limits; more means that its zero is wrong."""
WEIGHT_A: Final = 0.65
"""Current to carry the stretched arm: 1.06 N m, by the smallest published torque constant 1.65 N m/A."""


class ArmSample(NamedTuple):
    """Measured at `at` [s]: tip [m], force of the environment on it [N], joints [rad]."""

    at: float
    tip: Vector
    force: Vector
    joints: Joints


class ArmExchange:
    """The work of the bus thread; a command is where the tip should go [m], None to stay.

    Args:
        options: Of the robot.
        connect: Opens the port, at every opening.
        interpolation: Receives (x, y, z, fx, fy, fz) of every cycle.
        clock: Monotonic [s].
        pause: Sleeps [s].
    """

    def __init__(
        self,
        options: DynamixelOptions,
        connect: Callable[[], MotorPort],
        interpolation: Interpolation,
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
    ) -> None:
        self._options = options
        self._connect = connect
        self._interpolation = interpolation
        self._clock = clock
        self._pause = pause
        self._gains, self._friction, self._current = options.gains, options.friction, options.current
        self._mechanics = Mechanics()
        self._goal = TipGoal(options.approach_m_s, PATIENCE_S)
        self._filter = ForceLowPass(options.force_cutoff_hz)
        self._pitch = 0.0
        self._cycle = 0
        self._missed = 0
        self._weight: Joints = (0.0, 0.0, 0.0, 0.0)
        self._port: MotorPort | None = None
        self._motors: Motors | None = None
        self._engaged = False
        self.hold_on_close = True
        """Whether `close` leaves the motors holding the arm, or limp."""

    def open(self) -> ArmSample:
        self._port = self._connect()
        try:
            return self._begin(self._port)
        except BaseException:
            self.close()
            raise

    def _begin(self, port: MotorPort) -> ArmSample:
        options = self._options
        bus = MotorBus(port, options.baud, options.ids, options.margin_s, self._clock, self._pause)
        motors = self._motors = Motors(
            bus, options.baud, options.watchdog_s, self._current, (XM430_W350,) * 4, "an OpenMANIPULATOR-X"
        )
        motors.find()
        if motors.current_limit < registers.counts_of_current(WEIGHT_A):
            raise HardwareFault(
                f"current limit (register 38) of {motors.current_limit} is too low to carry the arm; "
                f"set it to {registers.counts_of_current(self._current)}"
            )
        check_pace(
            motors.first_present,
            self._options.rate_hz,
            self._clock,
            port.path,
            lambda: latency_advice(port.path) or "use a higher baud, or an adapter or a host that is not so slow",
        )
        now = self._clock()
        present = motors.first_present()
        self._check_zero(bus, present)
        arm = self._mechanics.pose(_joints(present))
        self._weight = arm.gravity
        self._engaged = True  # from here on, `close` must make the motors safe
        motors.engage(self._counts(self._weight))
        self._pitch = arm.pitch if options.pitch is None else options.pitch
        self._goal.place(arm.tip, now)
        self._filter.restart()
        self._cycle = self._missed = 0
        sample = self._sample(arm, present, now)
        self._interpolation.restart(_flat(sample))
        return sample

    @staticmethod
    def _check_zero(bus: MotorBus, present: list[MotorReading]) -> None:
        for id_, angle, low, high in zip(bus.ids, _joints(present), LOWER, UPPER, strict=True):
            if not low - BEYOND_RAD <= angle <= high + BEYOND_RAD:
                raise HardwareFault(
                    f"{bus.label(id_)}: stands at {angle:.2f} rad, where it cannot be ({low:.2f} to {high:.2f}): "
                    "check its zero, and that ids are in the order of the joints"
                )

    def exchange(self, command: Vector | None) -> ArmSample:
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
            self._missed += 1
            if self._missed > 1:  # after the second miss, the motors carry the weight only
                motors.command(self._counts(self._weight))
            raise
        self._missed = 0
        now = self._clock()
        arm = self._mechanics.pose(_joints(present))
        goal = self._goal.next(command, arm.tip, now)
        torques = joint_torques(arm, _rates(present), goal, self._pitch, self._gains)
        motors.command(self._counts(torques))
        self._weight = arm.gravity
        sample = self._sample(arm, present, 0.5 * (asked + now))
        self._interpolation.add(_flat(sample))
        return sample

    def _counts(self, torques: Joints) -> tuple[int, ...]:
        amperes = currents(torques, self._options.torque_constant_n_m_a, self._current)
        return tuple([registers.counts_of_current(each) for each in amperes])

    def _sample(self, arm: ArmPose, present: list[MotorReading], at: float) -> ArmSample:
        per_count = self._options.torque_constant_n_m_a * registers.A_PER_COUNT
        a, b, c, d = present
        torques = (a.current * per_count, b.current * per_count, c.current * per_count, d.current * per_count)
        force = tip_force(arm, _rates(present), torques, self._friction)
        return ArmSample(at, arm.tip, self._filter.next(force, at), arm.joints)

    def close(self) -> None:
        """Leave the arm holding itself, or limp, if the motors were engaged; any number of times."""
        motors, self._motors = self._motors, None
        engaged, self._engaged = self._engaged, False
        if motors is not None and engaged:
            with suppress(HardwareFault):
                motors.command(self._counts(self._weight))  # ends any pressing
            motors.leave(self.hold_on_close)
        port, self._port = self._port, None
        if port is not None:
            port.close()


def _joints(present: list[MotorReading]) -> Joints:
    a, b, c, d = present
    angle = registers.angle
    return (angle(a.position), angle(b.position), angle(c.position), angle(d.position))


def _rates(present: list[MotorReading]) -> Joints:
    a, b, c, d = present
    unit = registers.RAD_S_PER_COUNT
    return (a.velocity * unit, b.velocity * unit, c.velocity * unit, d.velocity * unit)


def _flat(sample: ArmSample) -> TimedValues:
    return TimedValues(sample.at, (*sample.tip, *sample.force))
