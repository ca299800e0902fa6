"""An end effector that is turned and feels torque, against formulas."""

from math import exp, pi, sqrt
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mujoco", reason="needs mujoco (extra: mujoco)")

from tests.slave.robots.mjcf.models import SLIDES, TICK, gantry, lead, robot, wall
from weberlink.geometry.rotation import Quaternion, angle_between, inverse, product, quaternion, vector
from weberlink.geometry.vector import ZERO, Vector, norm, scale, subtract
from weberlink.slave.robots.contract import RobotReading
from weberlink.slave.robots.mjcf.driver import MujocoRobot

BALL = SLIDES + '<joint name="ball" type="ball"/>'
TWIST = '<torque name="twist" site="flange"/></sensor>'
INERTIA = """<geom type="box" size="0.01 0.01 0.02" pos="0.01 0.02 0" mass="0.2" contype="0" conaffinity="0"/>"""


def turning(**options: Any) -> dict[str, Any]:
    return {"rotation": options}


def orientation_of(made: MujocoRobot) -> Quaternion:
    pose = made._simulation._pose
    assert pose is not None
    return pose._orientation()


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


@pytest.mark.parametrize("ratio", [0.5, 1.0])
def test_a_step_is_that_of_the_damped_oscillator(tmp_path: Path, ratio: float) -> None:
    """A box of 0.2 kg about its middle: J = m (a^2 + b^2) / 3 with half edges, about z."""
    inertia = 0.2 * 2.0 * 0.03**2 / 3.0
    box = '<geom type="box" size="0.03 0.03 0.03" mass="0.2" contype="0" conaffinity="0"/>'
    text = f"""<mujoco><option timestep="0.0001"/><worldbody><body>{SLIDES}<joint type="ball"/>{box}
        <site name="tip"/></body></worldbody></mujoco>"""
    made = robot(tmp_path, text, damping_ratio=ratio, **turning(stiffness_n_m_rad=0.5))
    made.open(0.0)
    omega, angles = sqrt(0.5 / inertia), []
    for _ in range(400):
        held(made, ZERO, quaternion((0.0, 0.0, 0.3)), 1)
        angles.append(vector(orientation_of(made))[2])
    if ratio == 1.0:
        assert angles == pytest.approx(
            [0.3 * (1.0 - (1.0 + omega * t) * exp(-omega * t)) for t in (TICK * n for n in range(1, 401))], abs=0.002
        )
    else:
        assert max(angles) == pytest.approx(0.3 * (1.0 + exp(-pi / sqrt(3.0))), rel=0.01)


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
