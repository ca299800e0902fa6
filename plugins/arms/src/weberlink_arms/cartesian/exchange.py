"""One control cycle of the arm: read all joints, compute impedance and force estimate, command the currents."""

from collections.abc import Callable
from contextlib import suppress
from time import monotonic, sleep
from typing import Any, Final, NamedTuple

from weberlink.geometry.joints import Joints as Axes
from weberlink.geometry.vector import Vector
from weberlink.hardware.fault import HardwareFault
from weberlink_arms.cartesian.arm import ArmPose, Joints, Mechanics, four
from weberlink_arms.cartesian.external_force import tip_force
from weberlink_arms.cartesian.impedance import TipGoal, joint_torques
from weberlink_arms.cartesian.options import DynamixelOptions
from weberlink_arms.dynamixel import registers
from weberlink_arms.dynamixel.bus import MotorBus, MotorReading
from weberlink_arms.dynamixel.exchange import MotorExchange
from weberlink_arms.dynamixel.motor_models import XM430_W350
from weberlink_arms.dynamixel.motors import Motors
from weberlink_arms.servo.driver import TimedValues
from weberlink_arms.servo.layout import CENTRE
from weberlink_arms.servo.options import AngleScale
from weberlink_arms.servo.position import LowPass

PATIENCE_S: Final = 0.1  # how long the last command holds when no more come
WEIGHT_A: Final = 0.65  # to carry the stretched arm: 1.06 N m, by the smallest published torque constant 1.65 N m/A


class TipSample(NamedTuple):
    """Measured at `at` [s]: tip [m], force of the environment on it [N], joints [rad]."""

    at: float
    tip: Vector
    force: Vector
    joints: Joints

    @property
    def flat(self) -> TimedValues:
        return TimedValues(self.at, (*self.tip, *self.force))


class ArmExchange(MotorExchange[Vector | None, TipSample]):
    """The work of the bus thread; a command is where the tip should go [m], None to stay."""

    ZERO_ADVICE = "check its zero, and that ids are in the order of the joints"

    def __init__(
        self,
        options: DynamixelOptions,
        connect: Callable[[], Any],
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
    ) -> None:
        super().__init__(options, connect, clock=clock, pause=pause)
        self._gains, self._friction, self._current = options.gains, options.friction, options.current
        self._mechanics = Mechanics()
        self._goal = TipGoal(options.approach_m_s, PATIENCE_S)
        self._filter = LowPass(options.force_cutoff_hz)
        self._pitch = 0.0
        self._arm: ArmPose | None = None
        self.hold_on_close = True  # else `close` leaves the motors limp

    def _made(self, bus: MotorBus) -> Motors:
        return Motors(bus, self._options.watchdog_s, self._current, (XM430_W350,) * 4, "an OpenMANIPULATOR-X")

    def _scaled(self, servos: Motors) -> AngleScale:
        if servos.current_limit < registers.counts_of_current(WEIGHT_A):
            raise HardwareFault(
                f"current limit (register 38) of {servos.current_limit} is too low to carry the arm; "
                f"set it to {registers.counts_of_current(self._current)}"
            )
        return AngleScale((1,) * 4, (CENTRE,) * 4)

    def _engage(self, angles: Axes, now: float) -> None:
        arm = self._arm = self._mechanics.pose(four(angles))
        self._servos.engage(self._counts(arm.gravity))
        self._pitch = arm.pitch if self._options.pitch is None else self._options.pitch
        self._goal.place(arm.tip, now)
        self._filter.restart()
        self._misses = 0

    def _act(self, command: Vector | None, present: list[MotorReading], angles: Axes, now: float) -> None:
        arm = self._arm = self._mechanics.pose(four(angles))
        goal = self._goal.next(command, arm.tip, now)
        torques = joint_torques(arm, _rates(present), goal, self._pitch, self._gains)
        self._servos.command(self._counts(torques))

    def _rest(self) -> None:
        """The motors carry the weight only."""
        assert self._arm is not None
        self._servos.command(self._counts(self._arm.gravity))

    def _counts(self, torques: Joints) -> tuple[int, ...]:
        constant = self._options.torque_constant_n_m_a
        return tuple([registers.counts_of_current(torque / constant) for torque in torques])

    def _sample(self, present: list[MotorReading], angles: Axes, at: float) -> TipSample:  # noqa: ARG002
        arm = self._arm
        assert arm is not None
        per_count = self._options.torque_constant_n_m_a * registers.A_PER_COUNT
        torques = four([each.current * per_count for each in present])
        x, y, z = self._filter.next(tip_force(arm, _rates(present), torques, self._friction), at)
        return TipSample(at, arm.tip, (x, y, z), arm.joints)

    def _leave(self) -> None:
        """Leave the arm holding itself, or limp."""
        with suppress(HardwareFault):
            self._rest()  # ends any pressing
        self._servos.leave(self.hold_on_close)


def _rates(present: list[MotorReading]) -> Joints:
    return four([each.velocity * registers.RAD_S_PER_COUNT for each in present])
