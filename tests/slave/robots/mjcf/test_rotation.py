"""An end effector that is turned and feels torque, against formulas; and the shipped wrench on its valve."""

from functools import cache
from math import cos, exp, pi, radians, sin, sqrt
from pathlib import Path
from random import Random
from typing import Any

import pytest
import yaml

pytest.importorskip("mujoco", reason="needs mujoco (extra: mujoco)")

from tests.slave.robots.mjcf.models import SLIDES, TICK, gantry, lead, robot, wall
from weberlink.geometry.rotation import IDENTITY, Quaternion, angle_between, inverse, product, quaternion, vector
from weberlink.geometry.vector import ZERO, Vector, norm, scale, subtract
from weberlink.slave.robots.contract import RobotReading
from weberlink.slave.robots.mjcf.driver import MujocoRobot
from weberlink.slave.robots.mjcf.rotation import PoseImpedance

CONFIGS = Path(__file__).parents[4] / "configs"
SPRING = 0.35
"""Of the shipped valve [N m/rad]."""
BALL = SLIDES + '<joint name="ball" type="ball"/>'
TWIST = '<torque name="twist" site="flange"/></sensor>'
INERTIA = """<geom type="box" size="0.01 0.01 0.02" pos="0.01 0.02 0" mass="0.2" contype="0" conaffinity="0"/>"""


def turning(**options: Any) -> dict[str, Any]:
    return {"rotation": options}


def pose_of(made: MujocoRobot) -> PoseImpedance:
    pose = made._simulation._pose
    assert pose is not None
    return pose


def orientation_of(made: MujocoRobot) -> Quaternion:
    return pose_of(made)._orientation()


def held(
    made: MujocoRobot, position: Vector, orientation: Quaternion, ticks: int, jitter: Random | None = None
) -> RobotReading:
    reading = made.latest(0.0)
    for _ in range(ticks):
        now = reading.at + TICK * (1.0 if jitter is None else jitter.uniform(0.3, 1.8))
        made.command(position, now)
        made.point(orientation, now)
        reading = made.latest(now)
    return reading


# --- control


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


# --- torque


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


def test_free_tool_feels_no_torque(tmp_path: Path) -> None:
    """Its weight beside the tip is known, and taken off."""
    text = gantry(joints=BALL, tool=INERTIA).replace("</sensor>", TWIST)
    made = robot(tmp_path, text, force="wrist", **turning(torque="twist"))
    made.open(0.0)
    for turn in ((0.0, 0.0, 0.0), (0.4, 0.0, 0.0), (0.4, -0.3, 0.8), (0.0, 1.0, 0.8)):
        reading = held(made, (0.01, 0.0, 0.0), quaternion(turn), 800)
        assert reading.torque == pytest.approx(ZERO, abs=1e-7)
        assert reading.force == pytest.approx(ZERO, abs=1e-6)


@pytest.mark.parametrize("ground", ["plane", "box"])  # of a contact, MuJoCo says a plane first, and a box last
def test_contact_torque_counts(tmp_path: Path, ground: str) -> None:
    """A ball that is spun on the ground (condim 4): at most 0.02 m times the force, with no lever to the tip."""
    rough = wall().replace('condim="1"', 'condim="4" friction="0.5 0.02 0"')
    if ground == "box":
        rough = rough.replace('"plane" size="1 1 0.1"', '"box" size="0.1 0.1 0.01"').replace("-0.005", "-0.015")
    text = gantry(rough, joints=BALL, tool=INERTIA).replace("</sensor>", TWIST)
    found = []
    for torque in ("contacts", "twist"):
        made = robot(tmp_path, text, force="wrist", **turning(torque=torque))
        lead(made, (0.0, 0.0, 0.01), (0.0, 0.0, -0.004))
        found.append([held(made, (0.0, 0.0, -0.004), quaternion((0.0, 0.0, 0.002 * n)), 1) for n in range(300)][-1])
    by_contacts, by_sensor = found
    assert -0.02 * by_contacts.force[2] < by_contacts.torque[2] < -0.008 * by_contacts.force[2]
    assert by_sensor.torque == pytest.approx(by_contacts.torque, abs=2e-4)


# --- errors


@pytest.mark.parametrize(
    ("text", "options", "named"),
    [
        (gantry(), {"torque": "twist"}, r"rotation\.torque: the model has no torque sensor with a name"),
        (
            gantry().replace("</sensor>", TWIST),
            {"torque": "twits"},
            r"rotation\.torque: .* 'twits'; nearest is 'twist'",
        ),
        (
            gantry().replace("</sensor>", '<torque name="twist" site="tip"/></sensor>'),
            {"torque": "twist"},
            r"rotation\.torque: .* 'tip', which has no force sensor beside it; add <force site=\"tip\"/>",
        ),
        (gantry(joints=BALL), {"stiffness_n_m_rad": 1e7}, r"rotation\.stiffness_n_m_rad: .* divide"),
    ],
)
def test_impossible_rotation_options_are_refused(
    tmp_path: Path, text: str, options: dict[str, Any], named: str
) -> None:
    with pytest.raises(ValueError, match=named) as caught:
        robot(tmp_path, text, **turning(**options))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("orientation", [(0.0,) * 4, (float("nan"), 0.0, 0.0, 0.0), (float("inf"), 1.0, 0.0, 0.0)])
def test_invalid_orientation_is_a_value_error(tmp_path: Path, orientation: Quaternion) -> None:
    made = robot(tmp_path, gantry(joints=BALL), **turning())
    made.open(0.0)
    with pytest.raises(ValueError, match="mujoco: commanded an orientation that is none"):
        made.point(orientation, 0.0)


# --- the shipped wrench


@cache
def named() -> dict[str, Any]:
    chosen: dict[str, Any] = yaml.safe_load((CONFIGS / "mujoco-wrench.yaml").read_text())["slave"]["robot"]
    assert chosen.pop("driver") == "mujoco"
    return chosen | {"model": CONFIGS / chosen["model"]}


def wrench(**rotation: Any) -> MujocoRobot:
    """On the valve, level."""
    options = named()
    made = MujocoRobot(MujocoRobot.Options(**(options | {"rotation": options["rotation"] | rotation})), None, TICK)
    made.open(0.0)
    x, y, z = made.latest(0.0).position
    for step in range(1, 201):
        held(made, (x, y, z * (1.0 - step / 200)), IDENTITY, 1)
    return made


def valve(made: MujocoRobot) -> float:
    plant = made._simulation._plant
    return float(plant.data.qpos[plant.model.joint("valve").qposadr[0]])


def about_z(degrees: float) -> Quaternion:
    return (cos(radians(degrees) / 2.0), 0.0, 0.0, sin(radians(degrees) / 2.0))


def turned_to(made: MujocoRobot, start: float, end: float, ticks: int = 300) -> RobotReading:
    for step in range(1, ticks + 1):
        held(made, ZERO, about_z(start + (end - start) * step / ticks), 1)
    return held(made, ZERO, about_z(end), 400)


@pytest.mark.parametrize("torque", ["contacts", "wrist torque"])
def test_torque_at_rest_is_that_of_the_valve_spring(torque: str) -> None:
    """Within half a percent, to either side, and no force comes with it; the valve is turned against it."""
    made, before = wrench(torque=torque), 0.0
    for goal in (10.0, 25.0, 40.0, 10.0, -20.0, -40.0):
        reading = turned_to(made, before, goal)
        angle, before = valve(made), goal
        assert abs(angle) > 0.6 * radians(abs(goal))
        assert reading.torque[2] == pytest.approx(-SPRING * angle, rel=0.005)
        assert norm((reading.torque[0], reading.torque[1], 0.0)) < 1e-3
        assert norm(reading.force) < 0.01
