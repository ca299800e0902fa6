"""The computed follower: what it feels, that it stays calm whatever it is told, and that time alone decides."""

from itertools import pairwise
from math import pi
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tests.session.systems import ARMS
from weberlink.geometry.joints import Joints, is_finite
from weberlink_mujoco.arms.follower import MujocoArm, MujocoArmOptions
from weberlink_mujoco.arms.models import load

TICK = 0.001
HARD = {"kind": "table", "position_m": (0.0, 0.0, 0.03), "time_constant_s": 1e-5}
"""A table as hard as MuJoCo allows, in the reach of every arm."""
MODEL = ARMS.with_name("arm.xml")
FRICTION = 0.005  # [N m] of its joints


def arm(**options: Any) -> MujocoArm:
    made = MujocoArm(MujocoArmOptions.model_validate({"model": MODEL} | options), TICK)
    made.open(0.0)
    return made


def hold(made: MujocoArm, angles: Joints, ticks: int, start: int = 0) -> Any:
    for tick in range(start + 1, start + ticks + 1):
        made.command(angles, tick * TICK)
        reading = made.latest(tick * TICK)
    return reading


def down(lift: float, elbow: float, gripper: float) -> Joints:
    """The arm with its hand down."""
    return (0.0, lift, elbow, pi / 2 - lift - elbow, 0.0, gripper)


def test_it_reaches_free_angles_and_feels_nothing() -> None:
    made = arm(stiffness_nm_rad=100.0)
    goal = tuple(0.9 * at + 0.1 * to for at, to in zip(made.latest(0.0).angles, made.spec.upper, strict=True))
    reading = hold(made, goal, 800)
    assert reading.angles == pytest.approx(goal, abs=FRICTION / 100.0 + 1e-3)
    assert reading.torques == pytest.approx((0.0,) * made.spec.axes, abs=2e-3)


def test_a_long_silence_is_skipped() -> None:
    made = arm(stiffness_nm_rad=1.0)
    made.command((1.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.0)
    assert made.latest(3600.0).angles[0] < 0.2


def test_an_end_stop_is_felt() -> None:
    made = arm(home_rad=(1.9, 0.0, 0.0, 0.0, 0.0, 0.0), torque_nm=2.0)
    made._simulation._upper[:] = 9.0  # commands are limited to the range, so that only a push goes beyond it
    reading = hold(made, (3.0, 0.0, 0.0, 0.0, 0.0, 0.0), 1500)
    assert reading.angles[0] == pytest.approx(made.spec.upper[0], abs=0.01)
    assert reading.torques[0] == pytest.approx(-2.0, abs=FRICTION + 0.01)


def test_a_box_is_gripped_and_lifted() -> None:
    """Its weight is felt on the way up, and the squeeze at the gripper all the time."""
    x, y, z = load(MODEL).tip(down(0.1, 0.6, 0.9))
    box = {"kind": "box", "position_m": (x + 0.015, y, z), "size_m": (0.02, 0.03, 0.038), "mass_kg": 0.2}
    table = {"kind": "table", "position_m": (0.0, 0.0, z - 0.02)}
    made = arm(home_rad=down(0.1, 0.6, 0.9), objects=[table, box], torque_nm=2.0)
    for tick in range(1, 3501):
        lift = 0.1 - 0.25 * min(max((tick - 1200) / 1500.0, 0.0), 1.0)
        made.command(down(lift, 0.6, max(0.0, 0.9 - 0.0009 * tick)), tick * TICK)
        reading = made.latest(tick * TICK)
    height = float(made._simulation._data.qpos[made.spec.axes + 2])
    lever = load(MODEL).tip(reading.angles)[0] - 0.0692 + 0.01  # from the axis of the shoulder to the box
    assert height > z + 0.02
    assert reading.angles[-1] > 0.2
    assert reading.torques[-1] == pytest.approx(2.0, abs=0.05)
    assert reading.torques[1] == pytest.approx(0.2 * 9.81 * lever, rel=0.1)


@settings(max_examples=20, deadline=None)
@given(
    stiffness=st.sampled_from([1e-3, 1.0, 100.0, 1e4, 1e6, 1e9]),
    ratio=st.sampled_from([0.0, 0.7, 10.0]),
    torque=st.sampled_from([1.0, 1e4]),
    goals=st.lists(st.sampled_from([-1e300, -9.0, -1.0, 0.0, 1.0, 9.0, 1e300]), min_size=6, max_size=60),
)
def test_no_gain_goal_or_contact_makes_it_diverge(
    stiffness: float, ratio: float, torque: float, goals: list[float]
) -> None:
    made = arm(stiffness_nm_rad=stiffness, damping_ratio=ratio, torque_nm=torque, objects=[HARD])
    axes = made.spec.axes
    for tick in range(1, 121):
        goal = tuple(goals[(tick // 10 + axis) % len(goals)] for axis in range(axes))
        made.command(goal, tick * TICK)
        reading = made.latest(tick * TICK)
        assert is_finite(reading.angles)
        assert max(map(abs, reading.torques)) <= torque
    speeds = made._simulation.speeds
    assert max(map(abs, speeds)) < 0.12 * torque / 1e-4  # all the time with the torque on the least inertia


@pytest.mark.parametrize("stiffness", [1.0, 30.0, 100.0])
def test_energy_only_falls_without_supply(stiffness: float) -> None:
    """Springs without damping pull the arm into a hard table: backward Euler and contacts may only take energy."""
    made = arm(stiffness_nm_rad=stiffness, damping_ratio=0.0, torque_nm=1e9, objects=[HARD])
    goal = (0.4, 0.9, 0.5, 0.45, 0.5, 0.5)
    energies = []
    for tick in range(1, 801):
        made.command(goal, tick * TICK)
        made.latest(tick * TICK)
        energies.append(energy(made, goal, stiffness))
    assert min(made._simulation._data.contact.dist, default=1.0) < 0.01  # it did touch, and rests there
    assert all(later <= earlier + 1e-4 * energies[0] for earlier, later in pairwise(energies))
    assert energies[-1] < 0.9 * energies[0]


def energy(made: MujocoArm, goal: Joints, stiffness: float) -> float:
    """Of the motion, without what the integration adds to the inertia, and of the springs [J]."""
    simulation = made._simulation
    model, data = simulation._model, simulation._data
    raised = model.dof_armature[simulation._axes].copy()
    model.dof_armature[simulation._axes] = simulation._own
    momentum = np.zeros(model.nv)
    mujoco.mj_crb(model, data)
    mujoco.mj_mulM(model, data, momentum, data.qvel)
    model.dof_armature[simulation._axes] = raised
    stretched = sum((to - at) ** 2 for to, at in zip(goal, simulation.angles, strict=True))
    return 0.5 * float(momentum @ data.qvel) + 0.5 * stiffness * stretched
