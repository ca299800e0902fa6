"""The arms on a bus of Dynamixel motors: joints, ids, motors and ranges.

Koch and OMX: names, ids and motors are those of LeRobot (huggingface/lerobot, teleoperators/koch_leader,
robots/koch_follower, teleoperators/omx_leader); those of the OMX are also in ROBOTIS-GIT/open_manipulator,
omx_l.ros2_control.xacro. All at 1 Mbit/s. Ranges: mujoco_menagerie, low_cost_robot_arm, for the Koch, approximate; one
turn for the OMX, whose description has placeholders. OpenMANIPULATOR-X: ROBOTIS-GIT/open_manipulator,
open_manipulator_x_position.ros2_control.xacro, where the motor of the gripper goes from 0.92 rad, closed, to -1.52 rad.
"""

from math import pi
from typing import Final

from weberlink_arms.dynamixel.motor_models import XL330_M077, XL330_M288, XL430_W250, XM430_W350
from weberlink_arms.servo.layout import LEROBOT_JOINTS, ArmLayout

KOCH_LEADER: Final = ArmLayout(
    name="koch_leader",
    title="a Koch v1.1 leader",
    joints=LEROBOT_JOINTS,
    ids=(1, 2, 3, 4, 5, 6),
    motors=(XL330_M077,) * 6,
    lower=(-2.2, -1.57, -1.57, -2.0, -pi, 0.0),
    upper=(2.2, 0.6, 1.45, 2.0, pi, 1.63),
    weight_nm=(0.0, 0.30, 0.13, 0.04, 0.01, 0.01),
    sign=(1,) * 6,
    offset_rad=(0.0,) * 6,
)
KOCH_FOLLOWER: Final = KOCH_LEADER._replace(
    name="koch_follower", title="a Koch v1.1 follower", motors=(XL430_W250,) * 2 + (XL330_M288,) * 4
)
OMX_LEADER: Final = KOCH_LEADER._replace(
    name="omx_leader",
    title="an OMX leader",
    motors=(XL330_M288,) * 5 + (XL330_M077,),
    lower=(-pi,) * 5 + (0.0,),
    upper=(pi,) * 5 + (1.0,),
    weight_nm=(0.0, 0.37, 0.20, 0.05, 0.01, 0.01),
)
OPEN_MANIPULATOR_X: Final = ArmLayout(
    name="open_manipulator_x",
    title="an OpenMANIPULATOR-X",
    joints=("joint1", "joint2", "joint3", "joint4"),
    ids=(11, 12, 13, 14, 15),
    motors=(XM430_W350,) * 5,
    lower=(-pi, -1.5, -1.5, -1.7, 0.0),
    upper=(pi, 1.5, 1.4, 1.97, 2.44),
    weight_nm=(0.0, 1.06, 0.51, 0.14, 0.0),
    sign=(1, 1, 1, 1, -1),
    offset_rad=(0.0, 0.0, 0.0, 0.0, 0.92),
)
