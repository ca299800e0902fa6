"""Mechanics of the emulated arm against laws and against MuJoCo."""

from random import Random

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from weberlink_arms.cartesian.arm import (
    LINKS,
    LOWER,
    ROTOR_INERTIA_KG_M2,
    UPPER,
    ArmLink,
    Joints,
    arm_pose,
)
from weberlink_arms.emulators.arm_dynamics import (
    mass_matrix,
    sliding,
    times,
    with_dry_friction,
)

NO_FRICTION = [0.0] * 4
angles = st.floats(-1.5, 1.5)
impulses = st.floats(-0.01, 0.01)


def drawn(random: Random, reach: float = 0.8) -> Joints:
    a, b, c, d = (random.uniform(reach * low, reach * high) for low, high in zip(LOWER, UPPER, strict=True))
    return a, b, c, d


def body(link: ArmLink, position: str, rod: str, inner: str) -> str:
    return (
        f'<body pos="{position}"><joint axis="0 1 0"/>'
        f'<inertial pos="{link.centre_x} 0 {link.centre_z}" mass="{link.mass}" diaginertia="{rod}"/>{inner}</body>'
    )


def test_equations_of_motion_are_those_of_mujoco() -> None:
    mujoco = pytest.importorskip("mujoco")
    _, upper, fore, hand = LINKS
    thin = 1e-15  # of a rod about itself
    arm = body(hand, "0.124 0 0", f"{thin} {hand.moment} {hand.moment}", "")
    arm = body(fore, "0.024 0 0.128", f"{thin} {fore.moment} {fore.moment}", arm)
    arm = body(upper, "0 0 0.0595", f"{upper.moment} {upper.moment} {thin}", arm)
    turning = LINKS[0].moment
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><compiler inertiafromgeom="false"/><option gravity="0 0 -9.81"/>'
        f'<default><joint armature="{ROTOR_INERTIA_KG_M2}"/></default>'
        '<worldbody><body pos="0.012 0 0.017"><joint axis="0 0 1"/>'
        f'<inertial pos="0 0 0.04" mass="0.1" diaginertia="{turning} {turning} {turning}"/>{arm}'
        "<site/></body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    random = Random(2)
    for _ in range(40):
        q, v = drawn(random), drawn(random, 3.0)
        torques = [random.uniform(-1, 1) for _ in range(4)]
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q, v, torques
        mujoco.mj_forward(model, data)
        pose = arm_pose(q)
        bias = [g + c for g, c in zip(pose.gravity, pose.coriolis(v), strict=True)]
        assert bias == pytest.approx(list(data.qfrc_bias), abs=1e-12)
        r = [torque - asked for torque, asked in zip(torques, bias, strict=True)]
        acceleration = sliding(mass_matrix(pose, ROTOR_INERTIA_KG_M2), r, NO_FRICTION, NO_FRICTION)
        assert acceleration == pytest.approx(list(data.qacc), rel=1e-9, abs=1e-9)


@example((0.0, 0.0, -1.0, 0.0), (0.0, 0.0, 0.0, -1 / 128), (0.0, 1e-5, 1e-5, 1e-5), (-1.0, -1.0, -1.0, 1.0))
@given(
    st.tuples(angles, angles, angles, angles),
    st.tuples(impulses, impulses, impulses, impulses),
    st.tuples(*[st.sampled_from((0.0, 1e-5, 1e-3, 1e-2))] * 4),
    st.tuples(*[st.sampled_from((-1.0, 0.0, 1.0))] * 4),
)
def test_each_joint_slides_with_full_friction_or_sticks(
    q: Joints, r: Joints, most: tuple[float, ...], before: Joints
) -> None:
    inertia = mass_matrix(arm_pose(q), 1e-4)
    v = with_dry_friction(inertia, r, most, before)
    held = [pushed - moving for pushed, moving in zip(r, times(inertia, v), strict=True)]
    for friction, limit, velocity in zip(held, most, v, strict=True):
        assert abs(friction) <= limit + 1e-12
        if velocity != 0.0 and limit > 0.0:
            assert abs(friction - (limit if velocity > 0.0 else -limit)) < 1e-12
