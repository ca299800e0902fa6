"""The mechanics of the emulated arm against laws, against the driver's own model, and against MuJoCo."""

from random import Random
from typing import Any

import pytest

from weberlink.geometry.vector import Vector
from weberlink.slave.emulators.dry_friction import sliding, times
from weberlink.slave.emulators.dynamics import STEP, STILL, Arm
from weberlink.slave.emulators.links import COULOMB, JOINTS, LINK_3, LINK_4, LINK_5, ROTOR_INERTIA, VISCOUS, Link
from weberlink.slave.emulators.pose import Joints, Pose
from weberlink.slave.emulators.tip_contact import along
from weberlink.slave.robots.dynamixel.arm import arm_pose
from weberlink.slave.scenes.settings import FrictionSettings, build, object_settings

POSE: Joints = (0.3, -0.6, 0.5, 0.8)
NO_FRICTION = [0.0] * 4
SETTLES: dict[str, Any] = {"rotor_inertia": 0.005, "viscous": (0.02, 0.02, 0.02, 0.02)}
"""An arm that comes to rest soon."""
WALL = object_settings(shape="plane", point_m=(0.19, 0.0, 0.0), normal=(-1.0, 0.0, 0.0), stiffness_n_m=1000.0)


def drawn(random: Random, reach: float = 0.8) -> Joints:
    a, b, c, d = (random.uniform(reach * joint.lower, reach * joint.upper) for joint in JOINTS)
    return a, b, c, d


def within_stops(arm: Arm) -> bool:
    return all(joint.lower <= angle <= joint.upper for joint, angle in zip(JOINTS, arm.angles, strict=True))


def servoed(arm: Arm, goal: Joints, time: float, stiffness: float = 8.0) -> list[float]:
    """Holds the arm at a goal by springs and dampers and the driver's idea of its weight; gives the last torques."""
    torques = [0.0] * 4
    for _ in range(round(time / STEP)):
        gravity = arm_pose(arm.angles).gravity
        torques = [
            g + stiffness * (there - q) - 0.3 * v
            for g, there, q, v in zip(gravity, goal, arm.angles, arm.velocities, strict=True)
        ]
        arm.step(torques)
    return torques


def test_kinematics_and_weight_are_those_of_the_driver() -> None:
    random = Random(1)
    for _ in range(50):
        q = drawn(random)
        pose, other = Pose(q), arm_pose(q)
        assert pose.tip == pytest.approx(other.tip, abs=1e-12)
        for mine, theirs in zip(pose.jacobian(), other.jacobian(), strict=True):
            assert mine == pytest.approx(theirs, abs=1e-12)
        force = (random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1))
        assert along(pose.jacobian(), force) == pytest.approx(other.torques(force), abs=1e-12)
        assert pose.equations(STILL, 0.0)[1] == pytest.approx(other.gravity, abs=1e-12)


def body(link: Link, position: str, inner: str) -> str:
    tensor = f"{link.ixx} {link.iyy} {link.izz} 0 {link.ixz} 0"
    return (
        f'<body pos="{position}"><joint axis="0 1 0"/>'
        f'<inertial pos="{link.x} 0 {link.z}" mass="{link.mass}" fullinertia="{tensor}"/>{inner}</body>'
    )


def test_equations_of_motion_are_those_of_mujoco() -> None:
    mujoco = pytest.importorskip("mujoco")
    chain = body(LINK_3, "0 0 0.0595", body(LINK_4, "0.024 0 0.128", body(LINK_5, "0.124 0 0", "")))
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><compiler inertiafromgeom="false"/><option gravity="0 0 -9.81"/>'
        f'<default><joint armature="{ROTOR_INERTIA}"/></default>'
        '<worldbody><body pos="0.012 0 0.017"><joint axis="0 0 1"/>'
        f'<inertial pos="0 0 0.04" mass="0.1" diaginertia="1.627e-5 1.627e-5 1.627e-5"/>{chain}'
        "</body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    random = Random(2)
    for _ in range(40):
        q, v = drawn(random), drawn(random, 3.0)
        torques = [random.uniform(-1, 1) for _ in range(4)]
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q, v, torques
        mujoco.mj_forward(model, data)
        inertia, bias = Pose(q).equations(v, ROTOR_INERTIA)
        assert bias == pytest.approx(list(data.qfrc_bias), abs=1e-12)
        r = [torque - asked for torque, asked in zip(torques, bias, strict=True)]
        assert sliding(inertia, r, NO_FRICTION, NO_FRICTION) == pytest.approx(list(data.qacc), rel=1e-9, abs=1e-9)


def accelerations(q: Joints, v: Joints) -> Joints:
    inertia, bias = Pose(q).equations(v, ROTOR_INERTIA)
    return sliding(inertia, [-b for b in bias], NO_FRICTION, NO_FRICTION)


def moved(x: Joints, dx: Joints, step: float) -> Joints:
    return (x[0] + step * dx[0], x[1] + step * dx[1], x[2] + step * dx[2], x[3] + step * dx[3])


def runge_kutta(q: Joints, v: Joints, step: float) -> tuple[Joints, Joints]:
    k1 = accelerations(q, v)
    v2 = moved(v, k1, step / 2)
    k2 = accelerations(moved(q, v, step / 2), v2)
    v3 = moved(v, k2, step / 2)
    k3 = accelerations(moved(q, v2, step / 2), v3)
    v4 = moved(v, k3, step)
    k4 = accelerations(moved(q, v3, step), v4)
    q = moved(moved(moved(moved(q, v, step / 6), v2, step / 3), v3, step / 3), v4, step / 6)
    return q, moved(moved(moved(moved(v, k1, step / 6), k2, step / 3), k3, step / 3), k4, step / 6)


def test_a_fall_without_friction_is_that_of_a_finer_method() -> None:
    q, v = (0.0, -0.4, 0.3, 0.2), (1.5, 0.5, -0.5, 1.0)
    arm = Arm(None, q, coulomb=STILL, viscous=STILL)
    arm.velocities = v
    energy = arm.energy()
    for _ in range(300):  # 0.15 s: before any stop
        arm.step(STILL)
        q, v = runge_kutta(q, v, STEP)
    assert within_stops(arm)
    assert abs(arm.angles[1] + 0.4) > 0.1
    assert arm.angles == pytest.approx(q, abs=2e-3)
    assert arm.velocities == pytest.approx(v, abs=2e-2)
    assert arm.energy() == pytest.approx(energy, abs=2e-3)


def test_a_step_obeys_the_equations_of_motion() -> None:
    random = Random(6)
    for _ in range(20):
        q, v = drawn(random), drawn(random, 2.0)
        torques = [random.uniform(-1, 1) for _ in range(4)]
        arm = Arm(None, q)
        arm._coulomb = NO_FRICTION
        arm.velocities = v
        arm.step(torques)
        inertia, bias = Pose(q).equations(v, ROTOR_INERTIA)
        changed = [
            after - before for after, before in zip(times(inertia, arm.velocities), times(inertia, v), strict=True)
        ]
        asked = [
            STEP * (torque - b - viscous * w)
            for torque, b, viscous, w in zip(torques, bias, VISCOUS, arm.velocities, strict=True)
        ]
        assert changed == pytest.approx(asked, abs=1e-12)


def test_energy_never_grows_in_a_passive_arm() -> None:
    random = Random(3)
    for _ in range(5):
        arm = Arm(None, drawn(random))
        arm.velocities = drawn(random, 2.0)
        energy = arm.energy()
        for _ in range(600):
            arm.step(STILL)
            now = arm.energy()
            assert now <= energy or not within_stops(arm)  # the energy of the stops is not counted
            energy = now


@pytest.mark.parametrize("stiffness", [300.0, 1e5, 1e7])
def test_a_dropped_arm_comes_to_rest_on_a_table(stiffness: float) -> None:
    cone = FrictionSettings(static=0.5, dynamic=0.4)
    table = object_settings(shape="plane", point_m=(0.0, 0.0, 0.05), stiffness_n_m=stiffness, friction=cone)
    arm = Arm(build([table]), (0.0, -0.2, 0.3, 0.4), **SETTLES)
    for _ in range(5500):
        arm.step(STILL)
        assert max(map(abs, arm.velocities)) < 20.0
    assert arm.velocities == STILL
    angles = arm.angles
    arm.step(STILL)
    assert arm.angles == angles
    assert arm.force[2] > 0.2
    assert abs(arm.force[0]) > 0.1  # leans on friction
    assert arm.force[2] == pytest.approx(stiffness * (0.05 - arm.tip[2]), rel=1e-6)


def test_statics_motors_and_wall_hold_the_weight() -> None:
    start = POSE
    arm = Arm(build([WALL]), start)
    assert arm.tip[0] < 0.19
    torques = servoed(arm, (start[0], start[1] + 0.3, start[2], start[3] - 0.3), 1.5)
    assert arm.force[0] < -1.0
    assert arm.force[1:] == (0.0, 0.0)
    held = arm_pose(arm.angles).torques(arm.force)
    for torque, pressed, weight, sticks in zip(torques, held, arm_pose(arm.angles).gravity, COULOMB, strict=True):
        assert abs(torque + pressed - weight) <= sticks + 1e-6


def test_statics_with_friction_on_the_wall() -> None:
    cone = FrictionSettings(static=0.9, dynamic=0.8)
    arm = Arm(build([WALL.model_copy(update={"friction": cone})]), POSE)
    servoed(arm, (POSE[0], POSE[1] + 0.3, POSE[2], POSE[3] - 0.3), 0.7)
    torques = servoed(arm, (POSE[0] + 0.15, POSE[1] + 0.3, POSE[2], POSE[3] - 0.3), 0.8)
    assert max(map(abs, arm.velocities)) < 1e-3
    assert abs(arm.force[1]) > 0.3
    held = arm_pose(arm.angles).torques(arm.force)
    for torque, pressed, weight, sticks in zip(torques, held, arm_pose(arm.angles).gravity, COULOMB, strict=True):
        assert abs(torque + pressed - weight) <= sticks + 1e-5


def test_without_dry_friction_statics_is_exact() -> None:
    ball = object_settings(shape="sphere", center_m=(0.25, 0.04, 0.09), radius_m=0.05, stiffness_n_m=800.0)
    arm = Arm(build([ball]), POSE, **SETTLES)
    arm._coulomb = NO_FRICTION
    torques = servoed(arm, (0.2, -0.2, 0.5, 0.3), 3.0)
    assert max(map(abs, arm.velocities)) < 1e-6
    force: Vector = arm.force
    assert max(map(abs, force)) > 0.5
    here = arm_pose(arm.angles)
    held = [weight - pressed for weight, pressed in zip(here.gravity, here.torques(force), strict=True)]
    assert torques == pytest.approx(held, abs=1e-5)


def test_a_joint_sticks_below_its_dry_friction_and_not_above() -> None:
    arm = Arm(None, POSE)
    for _ in range(200):
        arm.step([0.036, *arm_pose(POSE).gravity[1:]])
    assert arm.angles == POSE
    arm.step([0.038, *arm_pose(POSE).gravity[1:]])
    assert arm.velocities[0] > 0.0
    assert arm.angles[1:] == POSE[1:]


def test_stops_hold() -> None:
    arm = Arm(None, (0.0, -1.0, 0.5, 0.0), **SETTLES)
    for _ in range(2000):
        arm.step((2.0, -2.0, 2.0, -2.0))
    for angle, joint in zip(arm.angles, JOINTS, strict=True):
        assert joint.lower - 0.02 < angle < joint.upper + 0.02
    assert max(map(abs, arm.velocities)) < 1e-6


@pytest.mark.parametrize("damping", [None, 50.0])
def test_contact_takes_energy_away(damping: float | None) -> None:
    surface = object_settings(shape="plane", point_m=(0.0, 0.0, 0.1), stiffness_n_m=2000.0, damping_n_s_m=damping)
    arm = Arm(build([surface]), (0.0, 0.1, 0.3, 0.0), coulomb=STILL, viscous=STILL)
    assert arm.tip[2] > 0.1
    arm.velocities = (0.0, 0.8, 0.4, 0.2)
    energy = arm.energy()
    deepest = 0.0
    for _ in range(400):
        arm.step(STILL)
        depth = max(0.0, 0.1 - arm.tip[2])
        deepest = max(deepest, depth)
        assert arm.force[2] >= 0.0
        assert arm.energy() + 1000.0 * depth**2 < energy + 2e-3
    assert deepest > 2e-4
