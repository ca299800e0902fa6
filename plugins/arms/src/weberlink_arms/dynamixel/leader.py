"""The leaders `koch_leader` and `omx_leader`: arms with small Dynamixel motors, which display torques by their current.

The motors follow a goal current without a position loop (operating mode 0), so the hand moves them against friction and
rotors only. How a torque becomes a current, and how well that is known: `weberlink_arms.dynamixel.motor_models`.
"""

from typing import ClassVar, Final

from pydantic import Field

from weberlink.arms.contract import ArmSpec
from weberlink.geometry.joints import Joints
from weberlink_arms.dynamixel.bus import ARM_USB
from weberlink_arms.dynamixel.exchange import TorqueExchange
from weberlink_arms.dynamixel.layouts import KOCH_LEADER, OMX_LEADER
from weberlink_arms.dynamixel.motor_models import CurrentLaw
from weberlink_arms.dynamixel.options import DynamixelArmOptions
from weberlink_arms.dynamixel.registers import GOAL_CURRENT
from weberlink_arms.servo.arm import ServoLeader, spec_of
from weberlink_arms.servo.exchange import gravity_of
from weberlink_arms.servo.layout import ArmLayout

HAND_N_M_S: Final = 0.023
"""Viscous friction of fingers on a handle: that of the grasp `pinch` of `weberlink.master.devices.hand_options`,
2.3 N s/m, 0.1 m from the joint. The motors have less than a third of it."""


class DynamixelLeaderOptions(DynamixelArmOptions):
    """Options of a leader. Lists have one entry for each axis, the gripper last."""

    GOAL_SIZE: ClassVar[int] = GOAL_CURRENT.size

    max_current_ma: float = Field(
        default=600.0, ge=20.0, le=1750.0, description="largest goal current of a motor, with that for the weight"
    )

    @property
    def stiffest(self) -> Joints:
        """Stiffest walls in a hand [N m/rad]: b / 2 T, viscous friction b, delay T of a reading and a cycle.

        A spring delayed by T is a spring with the damper -k T to first order; at b / T the damping is used up.
        """
        delay = self.lag_s + 1.0 / self.rate_hz
        return tuple(0.5 * (model.viscous_n_m_s + HAND_N_M_S) / delay for model in self.LAYOUT.motors)


class KochLeaderOptions(DynamixelLeaderOptions):
    """Options of `koch_leader`. Lists: shoulder_pan, shoulder_lift, elbow_flex, wrist_flex, wrist_roll, gripper."""

    LAYOUT: ClassVar[ArmLayout] = KOCH_LEADER


class OmxLeaderOptions(DynamixelLeaderOptions):
    """Options of `omx_leader`. Lists: shoulder_pan, shoulder_lift, elbow_flex, wrist_flex, wrist_roll, gripper."""

    LAYOUT: ClassVar[ArmLayout] = OMX_LEADER


class DynamixelLeader(ServoLeader):
    """A leader on a bus of Dynamixel motors. Their bus watchdogs let go when this process stops."""

    USB = ARM_USB

    def __init__(self, options: DynamixelLeaderOptions, tick_period: float) -> None:
        gravity = gravity_of(options.LAYOUT.name, options.gravity)
        exchange = TorqueExchange(options, self.port(options, options.LAYOUT.name), gravity)
        super().__init__(options, _spec(options), exchange, tick_period)


class KochLeader(DynamixelLeader):
    """A Koch v1.1 leader: six XL330-M077."""

    Options = KochLeaderOptions


class OmxLeader(DynamixelLeader):
    """An OMX leader of ROBOTIS: five XL330-M288, and an XL330-M077 at the gripper."""

    Options = OmxLeaderOptions


def _spec(options: DynamixelLeaderOptions) -> ArmSpec:
    model = options.LAYOUT.motors[0]  # the note is by that of the first joint
    sheet = f"torques are those of the data sheet, {model.constant:.3g} N m/A within {model.constant_error:.0%}"
    parts = [
        *([sheet] if options.torque_ratio is None else []),
        f"a hand feels {model.coulomb_n_m:.2g} N m of friction and a rotor of {model.rotor_kg_m2:.1g} kg m^2 per joint",
    ]
    if options.laws[0] is CurrentLaw.SUPPLY:
        parts.append("the motors measure the current of their supply, and small torques are the least certain")
    if options.gravity:
        parts.append("gravity compensation by a model: check sign and offset_rad first")
    return spec_of(
        options,
        torque_nm=options.most,
        stiffness_nm_rad=options.stiffest,
        calibrated=options.torque_ratio is not None,
        watchdog_s=options.lets_go_s,
        note=options.note(*parts),
    )
