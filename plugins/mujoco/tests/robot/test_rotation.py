"""An end effector that is turned and feels torque, against formulas."""

from pathlib import Path
from typing import Any

import pytest

from plugins.mujoco.tests.robot.models import SLIDES, TICK, gantry, lead, robot, wall
from weberlink.geometry.rotation import Quaternion, angle_between, inverse, product, quaternion
from weberlink.geometry.vector import Vector, norm, scale, subtract
from weberlink.slave.robots.contract import RobotReading
from weberlink_mujoco.robot.driver import MujocoRobot

BALL = SLIDES + '<joint name="ball" type="ball"/>'
TWIST = '<torque name="twist" site="flange"/></sensor>'
INERTIA = """<geom type="box" size="0.01 0.01 0.02" pos="0.01 0.02 0" mass="0.2" contype="0" conaffinity="0"/>"""


def turning(**options: Any) -> dict[str, Any]:
    return {"rotation": options}


def orientation_of(made: MujocoRobot) -> Quaternion:
    return made._simulation._control._orientation()


def held(made: MujocoRobot, position: Vector, orientation: Quaternion, ticks: int) -> RobotReading:
    reading = made.latest(0.0)
    for _ in range(ticks):
        now = reading.at + TICK
        made.command(position, now)
        made.point(orientation, now)
        reading = made.latest(now)
    return reading


@pytest.mark.parametrize("turn", [(0.5, 0.0, 0.0), (0.0, -1.0, 0.6), (2.0, 1.0, -2.0)])
def test_orientation_is_relative_to_home_in_world_axes(tmp_path: Path, turn: Vector) -> None:
    """In gravity, with its centre of mass beside the joint, and a site that is turned in its body."""
    tool = INERTIA + '<site name="grip" pos="0.01 0 0.01" euler="20 30 40"/>'
    made = robot(tmp_path, gantry(joints=BALL, tool=tool), end_effector="grip", **turning())
    made.open(0.0)
    home, place = orientation_of(made), made.latest(0.0).position
    steps = 500
    for step in range(1, steps + 1):
        reading = held(made, place, quaternion(scale(turn, step / steps)), 1)
    reading = held(made, place, quaternion(turn), 500)
    assert norm(subtract(reading.position, place)) < 1e-6
    assert angle_between(product(orientation_of(made), inverse(home)), quaternion(turn)) < 1e-6


@pytest.mark.parametrize("torque", ["contacts", "twist"])
@pytest.mark.parametrize("joints", [SLIDES, BALL], ids=["slides", "ball"])
def test_torque_is_that_of_contacts_about_the_tip(tmp_path: Path, joints: str, torque: str) -> None:
    """The tip is 2 cm beside the ball that presses on the ground, so it is f times 2 cm about y."""
    text = gantry(wall(), joints=joints, tool=INERTIA + '<site name="side" pos="0.02 0 0"/>').replace(
        "</sensor>", TWIST
    )
    made = robot(tmp_path, text, end_effector="side", force="wrist", **turning(torque=torque, stiffness_n_m_rad=50.0))
    reading = lead(made, (0.02, 0.0, 0.01), (0.02, 0.0, -0.004))
    assert reading.force[2] > 1.0
    assert norm((reading.force[0], reading.force[1], 0.0)) < 1e-3
    assert reading.torque == pytest.approx((0.0, 0.02 * reading.force[2], 0.0), abs=1e-4 * reading.force[2])
