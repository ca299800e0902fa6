"""What is known of an arm before it is opened."""

from typing import TYPE_CHECKING, Final, NamedTuple

from weberlink.geometry.joints import Joints

if TYPE_CHECKING:
    from weberlink_arms.dynamixel.motor_models import MotorModel

GRIPPER: Final = "gripper"
LEROBOT_JOINTS: Final = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")


class ArmLayout(NamedTuple):
    """An arm. All tuples have one entry for each axis, the gripper last.

    Args:
        name: Of driver and model.
        title: For messages.
        joints: Names without the gripper.
        ids: Of the servos on the bus.
        lower, upper: Range [rad].
        sign: Direction of the angles against the counting of the servos.
        offset_rad: Angle where the servo counts 2048 [rad].
        weight_nm: Largest torque of the arm's own weight [N m]; a bound without a model.
        motors: Models of Dynamixel motors.
    """

    name: str
    title: str
    joints: tuple[str, ...]
    ids: tuple[int, ...]
    lower: Joints
    upper: Joints
    sign: tuple[int, ...]
    offset_rad: Joints
    weight_nm: Joints = ()
    motors: tuple["MotorModel", ...] = ()

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of all axes."""
        return (*self.joints, GRIPPER)
