"""The arm by its formulas: its pose, the force that presses on it, springs and dampers, and the goal of the tip."""

from itertools import pairwise
from math import hypot

import pytest
from hypothesis import given, strategies as st

from weberlink.geometry.vector import ZERO, Vector, add, distance, norm
from weberlink_arms.cartesian.arm import (
    COULOMB_N_M,
    LOWER,
    UPPER,
    VISCOUS_N_M_S,
    Joints,
    Mechanics,
    inverse,
    inverse_nearest,
    within_limits,
)
from weberlink_arms.cartesian.external_force import force_error, tip_force
from weberlink_arms.cartesian.impedance import LIMIT_MARGIN_RAD, ImpedanceGains, TipGoal, joint_torques
from weberlink_arms.dynamixel.motor_models import JointFriction
from weberlink_mujoco.arms.models import load

POSE = Mechanics().pose
MODEL = load("open_manipulator_x")
FRICTION = JointFriction(COULOMB_N_M, VISCOUS_N_M_S)
STILL: Joints = (0.0, 0.0, 0.0, 0.0)


def four(low: float, high: float) -> st.SearchStrategy[Joints]:
    return st.tuples(*[st.floats(low, high)] * 4)


poses, free = (
    st.tuples(*[st.floats(low + margin, high - margin) for low, high in zip(LOWER, UPPER, strict=True)])
    for margin in (0.0, 0.3)
)
places = st.tuples(st.floats(0.12, 0.26), st.floats(-0.12, 0.12), st.floats(0.05, 0.25))
forces = st.tuples(*[st.floats(-5.0, 5.0)] * 3)


@given(poses, forces, four(-2.0, 2.0))
def test_a_pose_is_that_of_the_model(joints: Joints, force: Vector, rates: Joints) -> None:
    """Its plane and its numbers are taken apart here, and put together again."""
    pose, axes = POSE(joints), (*joints, 0.0)
    rows = MODEL.jacobian(axes)
    push = [sum(f * row[axis] for f, row in zip(force, rows, strict=True)) for axis in range(4)]
    assert pose.torques(force) == pytest.approx(push, abs=1e-9)
    assert (*pose.gravity, 0.0) == pytest.approx(MODEL.gravity(axes))
    mass = [[*row[:4]] for row in MODEL.mass(axes)[:4]]
    for axis, row in enumerate(mass):
        row[axis] += 0.045 - MODEL.armature[axis]
    momentum = [sum(m * rate for m, rate in zip(row, rates, strict=True)) for row in mass]
    assert pose.momentum(rates, 0.045) == pytest.approx(momentum)


@given(places, st.floats(0.0, 1.2))
def test_the_inverse_leads_where_it_was_asked_to(tip: Vector, pitch: float) -> None:
    joints = inverse_nearest(tip, pitch)
    assert joints is not None, "the default workspace is within reach"
    assert within_limits(joints)
    assert distance(POSE(joints).tip, tip) < 1e-9
    if inverse(tip, pitch) is not None:
        assert POSE(joints).pitch == pytest.approx(pitch, abs=1e-9)


# --- the force on the tip


def at_work(place: Vector) -> Joints:
    joints = inverse_nearest(place, 0.3)
    assert joints is not None
    return joints


def balanced(joints: Joints, force: Vector, friction: Joints) -> Joints:
    """Torques of motors that hold the arm against its weight, a force on its tip and a friction that opposes."""
    here = POSE(joints)
    a, b, c, d = (
        weight - pressed + rubbing
        for weight, pressed, rubbing in zip(here.gravity, here.torques(force), friction, strict=True)
    )
    return (a, b, c, d)


@given(places, forces, four(-1.0, 1.0), st.floats(-0.4, 0.4))
def test_estimate_stays_within_stated_error(place: Vector, force: Vector, sticking: Joints, wrong: float) -> None:
    joints = at_work(place)
    here, friction = POSE(joints), FRICTION
    e, f, g, h = (part * coulomb for part, coulomb in zip(sticking, COULOMB_N_M, strict=True))
    a, b, c, d = (torque / (1.0 + wrong) for torque in balanced(joints, force, (e, f, g, h)))  # as the currents say
    felt = tip_force(here, STILL, (a, b, c, d), friction)
    newtons, share = force_error(here, friction, 0.4)
    assert distance(felt, force) <= newtons + share * norm(felt) + 1e-9


@given(places, forces, four(0.06, 1.0), st.tuples(*[st.sampled_from((-1.0, 1.0))] * 4))
def test_in_motion_the_friction_is_taken_out(place: Vector, force: Vector, speeds: Joints, ways: Joints) -> None:
    joints = at_work(place)
    a, b, c, d = (speed * way for speed, way in zip(speeds, ways, strict=True))
    e, f, g, h = (
        coulomb * way + viscous * speed * way
        for coulomb, viscous, speed, way in zip(COULOMB_N_M, VISCOUS_N_M_S, speeds, ways, strict=True)
    )
    felt = tip_force(POSE(joints), (a, b, c, d), balanced(joints, force, (e, f, g, h)), FRICTION)
    assert distance(felt, force) < 1e-9


# --- springs, dampers and limits


def torque(joints: Joints, offset: Vector = ZERO, speeds: Joints = STILL) -> Joints:
    """Without the weight, for a goal at this offset from the tip [m]."""
    here = POSE(joints)
    given_ = joint_torques(here, speeds, add(here.tip, offset), here.pitch, ImpedanceGains())
    a, b, c, d = (tau - weight for tau, weight in zip(given_, here.gravity, strict=True))
    return (a, b, c, d)


@given(free, st.tuples(*[st.floats(-0.2, 0.2)] * 3))
def test_spring_force_is_bounded(joints: Joints, offset: Vector) -> None:
    stiffness = ImpedanceGains().stiffness
    stretched = stiffness * hypot(*offset)
    scale = stiffness * min(1.0, 5.0 / stretched) if stretched > 0.0 else 0.0
    x, y, z = offset
    wanted = POSE(joints).torques((scale * x, scale * y, scale * z))
    assert torque(joints, offset) == pytest.approx(wanted, abs=1e-9)


@given(free, four(-2.0, 2.0))
def test_the_damper_only_takes_energy(joints: Joints, speeds: Joints) -> None:
    power = sum(tau * rate for tau, rate in zip(torque(joints, ZERO, speeds), speeds, strict=True))
    assert power <= 0.0
    gains = ImpedanceGains()
    energy = 0.5 * sum(p * rate for p, rate in zip(POSE(joints).momentum(speeds, gains.rotor), speeds, strict=True))
    assert power == pytest.approx(-2.0 * gains.damping_rate * energy, abs=1e-9), "all motion dies away at the same rate"


@given(poses)
def test_limit_springs_act_near_limits_only(joints: Joints) -> None:
    pushing = torque(joints)
    if within_limits(joints, LIMIT_MARGIN_RAD):
        assert pushing == pytest.approx(STILL, abs=1e-12)
    for q, low, high, tau in zip(joints, LOWER, UPPER, pushing, strict=True):
        if q < low + LIMIT_MARGIN_RAD - 1e-6:
            assert tau > 0.0
        elif q > high - LIMIT_MARGIN_RAD + 1e-6:
            assert tau < 0.0


# --- the goal of the tip

HERE: Vector = (0.2, 0.0, 0.1)
THERE: Vector = (0.2, 0.0, 0.12)
PERIOD = 0.004


@pytest.fixture
def goal() -> TipGoal:
    """Placed at 5 s."""
    goal = TipGoal(0.1, 0.1)
    goal.place(HERE, 5.0)
    return goal


def run(goal: TipGoal, command: Vector | None, tip: Vector, begin: float, cycles: int) -> list[Vector]:
    return [goal.next(command, tip, begin + (number + 1) * PERIOD) for number in range(cycles)]


def test_first_command_is_approached_at_limited_speed(goal: TipGoal) -> None:
    points = run(goal, THERE, HERE, 5.0, 60)
    assert not goal.holding
    assert all(distance(a, b) <= 0.1 * PERIOD + 1e-12 for a, b in pairwise([HERE, *points]))
    assert points[40] != THERE
    assert points[-1] == THERE
    assert goal.next(HERE, HERE, 6.0) == HERE


def test_goal_holds_after_pause_and_resumes_smoothly(goal: TipGoal) -> None:
    run(goal, THERE, HERE, 5.0, 60)
    pressed_at = (0.2, 0.0, 0.113)
    run(goal, None, pressed_at, 5.24, 30)
    assert goal.holding
    assert goal.next(None, (0.21, 0.0, 0.1), 5.4) == pressed_at, "where it was then, not where it drifts to"
    first = goal.next(THERE, pressed_at, 5.404)
    assert 0.0 < distance(first, pressed_at) <= 0.1 * PERIOD + 1e-12
