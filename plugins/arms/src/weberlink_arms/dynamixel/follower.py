"""The followers `koch_follower` and `open_manipulator_x`: arms with Dynamixel motors under their own position control.

Motors that measure their current are in current-based position control (operating mode 5), so that a goal current
limits how hard they push. An XL430 has no such mode and is in extended position control (mode 4), without a limit but
its own; it tells a load, from which a torque can be guessed only.
"""

from collections.abc import Callable, Sequence
from enum import StrEnum
from typing import Annotated, ClassVar, Final

from pydantic import Field, model_validator

from weberlink.arms.contract import ArmSpec
from weberlink.arms.threaded_arm import ThreadedArm
from weberlink.geometry.joints import Joints
from weberlink.hardware.discovery import PluggedDevice, UsbId, only, serial_ports
from weberlink.hardware.serial_port import SerialPort
from weberlink.registry import Tier
from weberlink_arms.cartesian import arm as open_manipulator
from weberlink_arms.dynamixel.arm_exchange import Gravity, PositionExchange, model_gravity, no_gravity
from weberlink_arms.dynamixel.bus import ARM_USB, MotorPort, latency_advice
from weberlink_arms.dynamixel.layouts import KOCH_FOLLOWER, OPEN_MANIPULATOR_X, ArmLayout
from weberlink_arms.dynamixel.motor_models import LOAD_FULL
from weberlink_arms.dynamixel.motors import watchdog_units
from weberlink_arms.dynamixel.options import DynamixelArmOptions
from weberlink_arms.dynamixel.registers import GOAL_POSITION, WATCHDOG_UNIT_S

STALE_S: Final = 0.1
"""A goal no longer counts this long after its command; the arm holds the last one [s]."""
ELBOW_GAIN: Final = 1500
"""Position gain that LeRobot gives the elbow of a Koch follower, whose own one is too soft for the weight behind it."""


class OnClose(StrEnum):
    """How the arm is left; `hold` is the default, since without torque it drops."""

    HOLD = "hold"
    LIMP = "limp"


class DynamixelFollowerOptions(DynamixelArmOptions):
    """Options of a follower. Lists have one entry for each axis, the gripper last."""

    GOAL_SIZE: ClassVar[int] = GOAL_POSITION.size
    COULOMB: ClassVar[Joints | None] = None
    VISCOUS: ClassVar[Joints | None] = None
    """Friction [N m], [N m s] where that of the motors is not the best known."""

    max_current_ma: float = Field(
        default=900.0, ge=50.0, le=3200.0, description="largest goal current of a motor; an XL430 has none"
    )
    speed_rad_s: float = Field(default=3.0, gt=0.0, le=20.0, description="largest of the goals")
    p_gain: tuple[int, ...] | None = Field(
        default=None, description="position gains (register 84), 0 to 16383; those as delivered if not given"
    )
    dead_zone_nm: tuple[Annotated[float, Field(ge=0.0, le=10.0)], ...] | None = Field(
        default=None, description="torques reported as 0, and taken off the larger ones; dry friction if not given"
    )
    torque_cutoff_hz: float = Field(
        default=50.0, ge=0.0, le=1e4, description="of the low-pass on the torques; 0 for none"
    )
    on_close: OnClose = Field(default=OnClose.HOLD, description="hold: the motors hold the arm; limp: it drops")

    @property
    def coulomb(self) -> Joints:
        """Dry friction [N m]."""
        return self.COULOMB or tuple(model.coulomb_n_m for model in self.LAYOUT.motors)

    @property
    def viscous(self) -> Joints:
        """Viscous friction [N m s]."""
        return self.VISCOUS or tuple(model.viscous_n_m_s for model in self.LAYOUT.motors)

    @property
    def dead_zone(self) -> Joints:
        """[N m]"""
        return self.coulomb if self.dead_zone_nm is None else self.dead_zone_nm

    @property
    def gains(self) -> tuple[int | None, ...]:
        return (None,) * len(self.LAYOUT.ids) if self.p_gain is None else self.p_gain

    @property
    def most(self) -> Joints:
        """Largest torques measured [N m]."""
        return tuple(
            ratio
            * model.torque(
                round(1e-3 * self.max_current_ma / model.a_per_count) if model.controls_current else round(LOAD_FULL),
                law,
            )
            for ratio, model, law in zip(self.ratios, self.LAYOUT.motors, self.laws, strict=True)
        )

    @property
    def torque_error(self) -> Joints:
        """Largest error of a measured torque at rest [N m].

        Friction at rest has either sign; the weight is off by the error of the torque constant, or unknown without a
        model; and the dead zone is taken off.
        """
        return tuple(
            friction + zone + (model.constant_error if self.gravity else 1.0) * weight
            for friction, zone, model, weight in zip(
                self.coulomb, self.dead_zone, self.LAYOUT.motors, self.LAYOUT.weight_nm, strict=True
            )
        )

    @model_validator(mode="after")
    def check_follower(self) -> "DynamixelFollowerOptions":
        count = len(self.LAYOUT.ids)
        for name, most in (("p_gain", 16_383), ("dead_zone_nm", 10.0)):
            values = getattr(self, name)
            if values is not None and (len(values) != count or not all(0 <= each <= most for each in values)):
                raise ValueError(f"{name}: expected {count} values from 0 to {most:g}, got {values}")
        return self


class KochFollowerOptions(DynamixelFollowerOptions):
    """Options of `koch_follower`. Lists: shoulder_pan, shoulder_lift, elbow_flex, wrist_flex, wrist_roll, gripper."""

    LAYOUT: ClassVar[ArmLayout] = KOCH_FOLLOWER

    @property
    def gains(self) -> tuple[int | None, ...]:
        return (None, None, ELBOW_GAIN, None, None, None) if self.p_gain is None else self.p_gain


class OpenManipulatorXOptions(DynamixelFollowerOptions):
    """Options of `open_manipulator_x`. Lists: joint1 to joint4, gripper."""

    LAYOUT: ClassVar[ArmLayout] = OPEN_MANIPULATOR_X
    COULOMB: ClassVar[Joints | None] = (*open_manipulator.COULOMB_N_M, 0.045)
    VISCOUS: ClassVar[Joints | None] = (*open_manipulator.VISCOUS_N_M_S, 0.0)

    max_current_ma: float = Field(default=1000.0, ge=650.0, le=3200.0, description="largest goal current of a motor")
    gravity: bool = Field(default=True, description="subtract the weight of the arm from the torques")


class DynamixelFollower(ThreadedArm[Joints | None]):
    """A follower on a bus of Dynamixel motors. Their bus watchdogs stop them when this process stops."""

    TIER: ClassVar[Tier] = "emulated only"
    USB: ClassVar[tuple[UsbId, ...]] = ARM_USB

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        """Adapters that may lead to an arm."""
        return serial_ports(cls.USB)

    def __init__(self, options: DynamixelFollowerOptions, gravity: Gravity) -> None:
        def connect() -> SerialPort:
            path = options.port or only(self.plugged(), options.LAYOUT.name, "slave.robot.port").path
            return SerialPort(path, options.baud)

        super().__init__(
            _spec(options),
            position_exchange(options, connect, gravity),
            rest=None,
            stale=STALE_S,
            bad_replies=options.bad_replies,
            reconnect=options.reconnect_s,
        )

    def follow(self, angles: Joints, now: float) -> None:
        self._command(angles, angles, now)


class KochFollower(DynamixelFollower):
    """A Koch v1.1 follower: two XL430-W250, four XL330-M288."""

    Options = KochFollowerOptions

    def __init__(self, options: KochFollowerOptions, tick_period: float) -> None:  # noqa: ARG002
        super().__init__(options, model_gravity(options.LAYOUT.name) if options.gravity else no_gravity)


class OpenManipulatorX(DynamixelFollower):
    """An OpenMANIPULATOR-X with its gripper: five XM430-W350."""

    Options = OpenManipulatorXOptions

    def __init__(self, options: OpenManipulatorXOptions, tick_period: float) -> None:  # noqa: ARG002
        super().__init__(options, model_gravity(options.LAYOUT.name) if options.gravity else no_gravity)


def position_exchange(
    options: DynamixelFollowerOptions, connect: Callable[[], MotorPort], gravity: Gravity
) -> PositionExchange:
    """The exchange of a follower with these options."""
    exchange = PositionExchange(
        options,
        connect,
        1e-3 * options.max_current_ma,
        gravity,
        dead_zone=options.dead_zone,
        coulomb=options.coulomb,
        viscous=options.viscous,
        speed=options.speed_rad_s,
        cutoff=options.torque_cutoff_hz,
        gains=options.gains,
    )
    exchange.hold_on_close = options.on_close is OnClose.HOLD
    return exchange


def _stiffness(options: DynamixelFollowerOptions, gains: Sequence[int | None]) -> Joints:
    return tuple(model.stiffness(gain) for model, gain in zip(options.LAYOUT.motors, gains, strict=True))


def _spec(options: DynamixelFollowerOptions) -> ArmSpec:
    layout, error = options.LAYOUT, options.torque_error
    blind = [name for name, motor in zip(layout.axes, layout.motors, strict=True) if not motor.controls_current]
    listed = ", ".join(f"{name} {each:.2g}" for name, each in zip(layout.axes, error, strict=True))
    parts = [f"torques are estimated from motor currents, at rest within {listed} N m"]
    if blind:
        parts.append(f"{' and '.join(blind)} measure no current, only a load: take their torques as a hint")
    advice = latency_advice(options.port) if options.port is not None else None
    return ArmSpec(
        name=layout.name,
        joints=layout.joints,
        gripper=True,
        lower=options.lower,
        upper=options.upper,
        torque_nm=options.most,
        stiffness_nm_rad=_stiffness(options, options.gains),
        rate_hz=options.rate_hz,
        calibrated=options.torque_ratio is not None,
        lag_s=options.lag_s,
        torque_error_nm=max(error),
        watchdog_s=WATCHDOG_UNIT_S * watchdog_units(options.watchdog_s),
        note="; ".join(parts if advice is None else [*parts, advice]),
    )
