"""What is known of an arm before it is opened, and the angles of its servos."""

from math import pi
from typing import TYPE_CHECKING, Final, NamedTuple

from weberlink.geometry.joints import Joints

if TYPE_CHECKING:
    from weberlink_arms.dynamixel.motor_models import MotorModel

COUNTS_PER_TURN: Final = 4096  # of all servos
CENTRE: Final = 2048
RAD_PER_COUNT: Final = 2.0 * pi / COUNTS_PER_TURN
GRIPPER: Final = "gripper"
LEROBOT_JOINTS: Final = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")


class ArmLayout(NamedTuple):
    """An arm. All tuples have one entry for each axis, the gripper last."""

    name: str  # of driver and model
    title: str  # for messages
    joints: tuple[str, ...]  # names without the gripper
    ids: tuple[int, ...]  # of the servos on the bus
    lower: Joints  # range [rad]
    upper: Joints
    sign: tuple[int, ...]  # direction of the angles against the counting of the servos
    offset_rad: Joints  # angle where the servo counts `CENTRE`
    weight_nm: Joints = ()  # largest torque of the arm's own weight; a bound without a model
    motors: tuple["MotorModel", ...] = ()  # models of Dynamixel motors

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of all axes."""
        return (*self.joints, GRIPPER)
