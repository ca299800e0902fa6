"""An end effector that is turned and feels torque, against formulas; and the shipped wrench on its valve."""

import subprocess
import sys
from functools import cache
from math import cos, exp, pi, radians, sin, sqrt
from pathlib import Path
from random import Random
from typing import Any

import pytest
import yaml

pytest.importorskip("mujoco", reason="needs mujoco (extra: mujoco)")

from tests.slave.robots.mjcf.models import SLIDES, TICK, chain, gantry, lead, robot, wall, written
from weberlink.geometry.rotation import IDENTITY, Quaternion, angle_between, inverse, product, quaternion, vector
from weberlink.geometry.vector import ZERO, Vector, add, dot, norm, scale, subtract
from weberlink.master.devices.operator import OperatorDevice, OperatorOptions
from weberlink.slave.robots.contract import OrientedRobot, RobotReading
from weberlink.slave.robots.mjcf.driver import MujocoRobot
from weberlink.slave.robots.mjcf.plant import Plant
from weberlink.slave.robots.mjcf.rotation import PoseImpedance

CONFIGS = Path(__file__).parents[4] / "configs"
SPRING = 0.35
"""Of the shipped valve [N m/rad]."""
BALL = SLIDES + '<joint name="ball" type="ball"/>'
TWIST = '<torque name="twist" site="flange"/></sensor>'
INERTIA = """<geom type="box" size="0.01 0.01 0.02" pos="0.01 0.02 0" mass="0.2" contype="0" conaffinity="0"/>"""


def turning(**options: Any) -> dict[str, Any]:
    return {"rotation": options}


def plant_of(made: MujocoRobot) -> Plant:
    return made._simulation._plant


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


def test_it_says_before_it_is_open_whether_it_can_be_turned(tmp_path: Path) -> None:
    assert robot(tmp_path, gantry()).spec.torque_n_m == 0.0
    made = robot(tmp_path, gantry(joints=BALL), **turning(torque_n_m=1.5))
    assert made.spec.torque_n_m == 1.5
    assert isinstance(made, OrientedRobot)
    assert "1000 N/m and 5 N m/rad" in made.description()


@pytest.mark.parametrize("turn", [(0.5, 0.0, 0.0), (0.0, -1.0, 0.6), (2.0, 1.0, -2.0)])
def test_it_turns_to_the_orientation_from_that_at_home_about_the_axes_of_the_world(
    tmp_path: Path, turn: Vector
) -> None:
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


def test_every_mode_of_a_coupled_tool_has_the_damping_ratio(tmp_path: Path) -> None:
    """A tool held far from its centre of mass: pushed and turned at once, nothing goes over by more than it should."""
    made = robot(tmp_path, gantry(joints=BALL, tool=INERTIA, timestep=0.0002), **turning(stiffness_n_m_rad=1.0))
    control = pose_of(made)
    import numpy as np  # noqa: PLC0415

    plant = plant_of(made)
    mobility = plant.twist @ plant.inverse_mass() @ plant.twist.T
    stiffness = np.diag([1000.0] * 3 + [1.0] * 3)
    damping = control._damping
    system = np.block([[np.zeros((6, 6)), np.eye(6)], [-mobility @ stiffness, -mobility @ damping]])
    roots = np.linalg.eigvals(system)
    # Critical damping makes pairs of equal roots, which rounding splits by the square root of its size.
    assert abs((-roots.real / np.abs(roots)) - 1.0).max() < 1e-3
    assert np.abs(roots).max() == pytest.approx(control.fastest, rel=1e-3)


def test_a_redundant_arm_turns_as_far_as_its_joints_let_it(tmp_path: Path) -> None:
    """Five joints cannot hold six numbers: the position gives way a little, and it stays calm."""
    made = robot(tmp_path, chain(), home_m=(0.0, 0.0, 0.04), **turning(stiffness_n_m_rad=2.0))
    made.open(0.0)
    for step in range(1, 501):
        held(made, (0.0, 0.0, 0.04), quaternion((0.0, 0.0004 * step, 0.0)), 1)
    reading = held(made, (0.0, 0.0, 0.04), quaternion((0.0, 0.2, 0.0)), 1500)
    turned = product(orientation_of(made), inverse(pose_of(made)._home))
    assert vector(turned)[1] == pytest.approx(0.2, abs=0.01)
    assert norm(subtract(reading.position, (0.0, 0.0, 0.04))) < 0.002


def test_a_thin_tool_is_calm_however_it_is_turned_and_a_second_session_is_like_the_first(tmp_path: Path) -> None:
    """Its inertia about the long axis is a fortieth of the other: damped for the wrong one it would not be stable."""
    made = robot(tmp_path, gantry(joints=BALL), **turning())
    runs = []
    for _ in range(2):
        made.open(0.0)
        run = [(held(made, ZERO, (0.6, 0.8, 0.0, 0.0), 1), orientation_of(made)) for _ in range(1000)]
        assert angle_between(orientation_of(made), (0.6, 0.8, 0.0, 0.0)) < 1e-4
        for turn in (0.25, 0.03):  # the last damping is that of a place which is near home, but not home
            run += [(held(made, ZERO, quaternion((turn, 0.0, 0.0)), 1), orientation_of(made)) for _ in range(300)]
        runs.append(run)
    assert runs[0] == runs[1]
    made.open(0.0)
    made.latest(0.5)
    assert angle_between(orientation_of(made), IDENTITY) < 1e-9, "not where the session before left it"


def test_without_rotation_nothing_of_it_is_imported_and_no_torque_is_read(tmp_path: Path) -> None:
    path = written(tmp_path, gantry(joints=BALL))
    words = (
        "import sys; from pathlib import Path; from weberlink.slave.robots.mjcf.driver import MujocoRobot;"
        f"made = MujocoRobot(MujocoRobot.Options(model=Path({str(path)!r}), rotation=ROTATION), None, 0.001);"
        "made.open(0.0); made.point((0.6, 0.8, 0.0, 0.0), 0.0); print(made.latest(0.1).torque,"
        "'weberlink.slave.robots.mjcf.rotation' in sys.modules)"
    )
    said = [
        subprocess.run(
            [sys.executable, "-c", words.replace("ROTATION", rotation)], capture_output=True, text=True, check=True
        ).stdout.strip()
        for rotation in ("None", "{}")
    ]
    assert said == ["(0.0, 0.0, 0.0) False", "(0.0, 0.0, 0.0) True"]


# --- torque


@pytest.mark.parametrize("torque", ["contacts", "twist"])
@pytest.mark.parametrize("joints", [SLIDES, BALL], ids=["slides", "ball"])
def test_the_torque_is_that_of_the_contact_about_the_tip(tmp_path: Path, joints: str, torque: str) -> None:
    """The tip is 2 cm beside the ball that presses on the ground, so it is f times 2 cm about y."""
    text = gantry(wall(), joints=joints, tool=INERTIA + '<site name="side" pos="0.02 0 0"/>').replace(
        "</sensor>", TWIST
    )
    made = robot(tmp_path, text, end_effector="side", force="wrist", **turning(torque=torque, stiffness_n_m_rad=50.0))
    reading = lead(made, (0.02, 0.0, 0.01), (0.02, 0.0, -0.004))
    assert reading.force[2] > 1.0
    assert norm((reading.force[0], reading.force[1], 0.0)) < 1e-3
    assert reading.torque == pytest.approx((0.0, 0.02 * reading.force[2], 0.0), abs=1e-4 * reading.force[2])


def test_a_tool_that_touches_nothing_feels_no_torque_however_it_is_held(tmp_path: Path) -> None:
    """Its weight beside the tip is known, and taken off."""
    text = gantry(joints=BALL, tool=INERTIA).replace("</sensor>", TWIST)
    made = robot(tmp_path, text, force="wrist", **turning(torque="twist"))
    made.open(0.0)
    for turn in ((0.0, 0.0, 0.0), (0.4, 0.0, 0.0), (0.4, -0.3, 0.8), (0.0, 1.0, 0.8)):
        reading = held(made, (0.01, 0.0, 0.0), quaternion(turn), 800)
        assert reading.torque == pytest.approx(ZERO, abs=1e-7)
        assert reading.force == pytest.approx(ZERO, abs=1e-6)


@pytest.mark.parametrize("ground", ["plane", "box"])  # of a contact, MuJoCo says a plane first, and a box last
def test_what_a_contact_transmits_itself_counts(tmp_path: Path, ground: str) -> None:
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


def test_it_is_cut_to_the_range_of_the_sensing(tmp_path: Path) -> None:
    text = gantry(wall(), tool='<site name="side" pos="0.02 0 0"/>')
    made = robot(tmp_path, text, end_effector="side", **turning(torque_n_m=0.01))
    assert lead(made, (0.02, 0.0, 0.01), (0.02, 0.0, -0.004)).torque == pytest.approx((0.0, 0.01, 0.0), abs=1e-6)


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
def test_what_cannot_be_is_refused_in_one_line(tmp_path: Path, text: str, options: dict[str, Any], named: str) -> None:
    with pytest.raises(ValueError, match=named) as caught:
        robot(tmp_path, text, **turning(**options))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("options", [{"stiffness_n_m_rad": 0}, {"torque_n_m": -1.0}, {"colour": "red"}])
def test_wrong_options_are_refused_by_name(tmp_path: Path, options: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(options))):
        MujocoRobot.Options(model=tmp_path, rotation=options)


@pytest.mark.parametrize("orientation", [(0.0,) * 4, (float("nan"), 0.0, 0.0, 0.0), (float("inf"), 1.0, 0.0, 0.0)])
def test_an_orientation_that_is_none_is_our_own_error(tmp_path: Path, orientation: Quaternion) -> None:
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
    plant = plant_of(made)
    return float(plant.data.qpos[plant.model.joint("valve").qposadr[0]])


def about_z(degrees: float) -> Quaternion:
    return (cos(radians(degrees) / 2.0), 0.0, 0.0, sin(radians(degrees) / 2.0))


def turned_to(made: MujocoRobot, start: float, end: float, ticks: int = 300) -> RobotReading:
    for step in range(1, ticks + 1):
        held(made, ZERO, about_z(start + (end - start) * step / ticks), 1)
    return held(made, ZERO, about_z(end), 400)


@pytest.mark.parametrize("torque", ["contacts", "wrist torque"])
def test_the_torque_at_rest_is_stiffness_times_angle_of_the_valve(torque: str) -> None:
    """Within half a percent, to either side, and no force comes with it; the valve is turned against it."""
    made, before = wrench(torque=torque), 0.0
    for goal in (10.0, 25.0, 40.0, 10.0, -20.0, -40.0):
        reading = turned_to(made, before, goal)
        angle, before = valve(made), goal
        assert abs(angle) > 0.6 * radians(abs(goal))
        assert reading.torque[2] == pytest.approx(-SPRING * angle, rel=0.005)
        assert norm((reading.torque[0], reading.torque[1], 0.0)) < 1e-3
        assert norm(reading.force) < 0.01


def test_the_wrench_has_a_little_play_and_the_valve_a_stop() -> None:
    made = wrench()
    assert turned_to(made, 0.0, 1.0).torque == pytest.approx(ZERO, abs=1e-6)
    assert turned_to(made, 1.0, 3.0).torque[2] < -0.003
    before = turned_to(made, 3.0, 50.0)
    after = turned_to(made, 50.0, 75.0)
    assert valve(made) < radians(50.0)
    assert after.torque[2] < before.torque[2] - 0.15
    assert -after.torque[2] > 1.3 * SPRING * valve(made), "what the stop takes"


def test_turning_the_valve_and_back_gives_no_more_than_was_put_in() -> None:
    """Work of the commanded turn on the robot, jittered ticks: less comes back than went in, nothing is left over."""
    made, jitter = wrench(), Random(3)
    for _ in range(3):
        work, last, before = 0.0, 0.0, made.latest(0.0)
        for step in range(1, 801):
            angle = radians(40.0) * sin(2.0 * pi * step / 800)
            reading = held(made, ZERO, about_z(angle * 180.0 / pi), 1, jitter)
            work -= 0.5 * (before.torque[2] + reading.torque[2]) * (angle - last)
            assert work > -0.002, "[J]; the spring stores 0.08 J"
            before, last = reading, angle
        assert work > 0.0


def test_it_is_calm_where_it_rests_and_the_same_run_is_the_same() -> None:
    runs = []
    for _ in range(2):
        made = wrench()
        turned_to(made, 0.0, 60.0)
        torques = [held(made, ZERO, about_z(60.0), 1, Random(4)).torque for _ in range(200)]
        assert max(norm(subtract(torque, torques[0])) for torque in torques) < 1e-5
        runs.append(torques)
    assert runs[0] == runs[1]


@pytest.mark.parametrize("seed", [1, 2])
def test_whatever_is_commanded_it_stays_finite_and_within_its_ranges(seed: int) -> None:
    """Thrown about between any orientations, at the valve and off it, with ticks that come early and late."""
    made, draw = wrench(), Random(seed)
    now, touched = made.latest(0.0).at, 0
    for tick in range(2000):
        now += TICK * draw.uniform(0.2, 1.9)
        if tick % draw.choice((1, 30, 200)) == 0:
            made.point((draw.gauss(0.0, 1.0), draw.gauss(0.0, 1.0), draw.gauss(0.0, 1.0), draw.gauss(0.0, 1.0)), now)
            made.command((draw.uniform(-0.03, 0.03), draw.uniform(-0.03, 0.03), draw.uniform(-0.02, 0.02)), now)
        reading = made.latest(now)
        assert norm(reading.torque) <= made.spec.torque_n_m * (1.0 + 1e-9)
        assert max(map(abs, reading.position)) < 0.2
        touched += reading.torque != ZERO
    assert touched > 100


def test_a_hand_with_a_wrist_and_the_valve_come_to_rest_in_balance() -> None:
    """Felt torque = k_hand (meant - turned) = k_valve valve, as over a link of two ticks."""
    script = [{"motion": "turn", "turn_deg": [0.0, 0.0, 40.0], "duration_s": 0.8}]
    hand = OperatorDevice(
        OperatorOptions(script=script, repeat=False, home_m=ZERO, tremor_m=0.0, wrist={"tremor_rad": 0.0}), TICK
    )
    hand.open(0.0)
    made = wrench()
    start, late = made.latest(0.0).at, [(ZERO, ZERO)] * 2
    for tick in range(1, 2501):
        reading = hand.latest(tick * TICK)
        made.command(reading.position, start + tick * TICK)
        assert reading.orientation is not None
        made.point(reading.orientation, start + tick * TICK)
        felt = made.latest(start + tick * TICK)
        late.append((felt.force, felt.torque))
        hand.command(late[-3][0], tick * TICK)
        hand.turn(late[-3][1], tick * TICK)
    turn = vector(reading.orientation)
    assert felt.torque[2] == pytest.approx(-2.0 * (radians(40.0) - turn[2]), rel=0.01)
    assert felt.torque[2] == pytest.approx(-SPRING * valve(made), rel=0.01)
    assert radians(25.0) < valve(made) < turn[2] < radians(39.0)
    assert dot(felt.force, felt.force) < 0.01
    assert add(turn, (0.0, 0.0, -turn[2])) == pytest.approx(ZERO, abs=1e-3)
