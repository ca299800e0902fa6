"""The followers `koch_follower` and `open_manipulator_x`: arms with Dynamixel motors under their own position control.

Motors that measure their current are in current-based position control (operating mode 5), so that a goal current
limits how hard they push. An XL430 has no such mode and is in extended position control (mode 4), without a limit but
its own; it tells a load, from which a torque can be guessed only.
"""

from typing import Annotated, ClassVar, Final

from pydantic import Field, model_validator

from weberlink.arms.contract import ArmSpec
from weberlink.geometry.joints import Joints
from weberlink_arms.cartesian.arm import COULOMB_N_M, VISCOUS_N_M_S
from weberlink_arms.dynamixel.bus import ARM_USB
from weberlink_arms.dynamixel.exchange import PositionExchange
from weberlink_arms.dynamixel.layouts import KOCH_FOLLOWER, OPEN_MANIPULATOR_X
from weberlink_arms.dynamixel.options import DynamixelArmOptions
from weberlink_arms.dynamixel.registers import GOAL_POSITION
from weberlink_arms.servo.arm import ServoFollower, spec_of
from weberlink_arms.servo.exchange import gravity_of
from weberlink_arms.servo.layout import ArmLayout
from weberlink_arms.servo.position import OnClose

ELBOW_GAIN: Final = 1500
"""Position gain that LeRobot gives the elbow of a Koch follower, whose own one is too soft for the weight behind it."""


class DynamixelFollowerOptions(DynamixelArmOptions):
    """Options of a follower. Lists have one entry for each axis, the gripper last."""

    GOAL_SIZE: ClassVar[int] = GOAL_POSITION.size
    LISTS = (*DynamixelArmOptions.LISTS, "p_gain", "dead_zone_nm")
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
    on_close: OnClose = Field(
        default=OnClose.HOLD,
        description="hold: the motors hold the arm; sink: it sinks slowly, then is limp; limp: it drops",
    )

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
    def stiffness(self) -> Joints:
        """Of the position control [N m/rad]."""
        axes = zip(self.ratios, self.LAYOUT.motors, self.gains, strict=True)
        return tuple(ratio * model.stiffness(gain) for ratio, model, gain in axes)

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
        if self.p_gain is not None and not all(0 <= each <= 16_383 for each in self.p_gain):
            raise ValueError(f"p_gain: expected values from 0 to 16383, got {self.p_gain}")
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
    COULOMB: ClassVar[Joints | None] = (*COULOMB_N_M, 0.045)
    VISCOUS: ClassVar[Joints | None] = (*VISCOUS_N_M_S, 0.0)

    max_current_ma: float = Field(default=1000.0, ge=650.0, le=3200.0, description="largest goal current of a motor")
    gravity: bool = Field(default=True, description="subtract the weight of the arm from the torques")


class DynamixelFollower(ServoFollower):
    """A follower on a bus of Dynamixel motors. Their bus watchdogs stop them when this process stops."""

    USB = ARM_USB

    def __init__(self, options: DynamixelFollowerOptions, tick_period: float) -> None:
        gravity = gravity_of(options.LAYOUT.name, options.gravity)
        exchange = PositionExchange(options, self.port(options, options.LAYOUT.name), gravity)
        super().__init__(options, _spec(options), exchange, tick_period)


class KochFollower(DynamixelFollower):
    """A Koch v1.1 follower: two XL430-W250, four XL330-M288."""

    Options = KochFollowerOptions


class OpenManipulatorX(DynamixelFollower):
    """An OpenMANIPULATOR-X with its gripper: five XM430-W350."""

    Options = OpenManipulatorXOptions


def _spec(options: DynamixelFollowerOptions) -> ArmSpec:
    layout, error = options.LAYOUT, options.torque_error
    blind = [name for name, motor in zip(layout.axes, layout.motors, strict=True) if not motor.controls_current]
    listed = ", ".join(f"{name} {each:.2g}" for name, each in zip(layout.axes, error, strict=True))
    parts = [f"torques are estimated from motor currents, at rest within {listed} N m"]
    if blind:
        parts.append(f"{' and '.join(blind)} measure no current, only a load: take their torques as a hint")
    return spec_of(
        options,
        torque_nm=options.most,
        stiffness_nm_rad=options.stiffness,
        calibrated=options.torque_ratio is not None,
        torque_error_nm=max(error),
        watchdog_s=options.lets_go_s,
        note=options.note(*parts),
    )
