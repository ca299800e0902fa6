"""The estimate recovers what presses on the tip, as far as it says it does."""

from math import atan2, hypot, pi, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.geometry.vector import ZERO, Vector, distance, norm, scale
from weberlink.slave.robots.dynamixel.arm import (
    COULOMB_N_M,
    LOWER,
    UPPER,
    VISCOUS_N_M_S,
    Joints,
    arm_pose,
    inverse_nearest,
)
from weberlink.slave.robots.dynamixel.external_force import ForceLowPass, JointFriction, force_error, tip_force

STILL: Joints = (0.0, 0.0, 0.0, 0.0)
NONE = JointFriction(STILL, STILL)
places = st.tuples(st.floats(0.12, 0.26), st.floats(-0.12, 0.12), st.floats(0.05, 0.25))
poses = st.tuples(*[st.floats(low, high) for low, high in zip(LOWER, UPPER, strict=True)])
forces = st.tuples(*[st.floats(-5.0, 5.0)] * 3)
signs = st.tuples(*[st.floats(-1.0, 1.0)] * 4)


def at_work(place: Vector) -> Joints:
    joints = inverse_nearest(place, 0.3)
    assert joints is not None
    return joints


def balanced(joints: Joints, force: Vector, friction: Joints = STILL) -> Joints:
    """Torques of motors that hold the arm against its weight, a force on its tip and a friction that opposes."""
    here = arm_pose(joints)
    a, b, c, d = (
        weight - pressed + rubbing
        for weight, pressed, rubbing in zip(here.gravity, here.torques(force), friction, strict=True)
    )
    return (a, b, c, d)


@given(places, forces)
def test_a_force_on_an_arm_without_friction_is_felt_exactly(place: Vector, force: Vector) -> None:
    joints = at_work(place)
    felt = tip_force(arm_pose(joints), STILL, balanced(joints, force), NONE)
    assert distance(felt, force) < 1e-9


def test_the_sign_is_that_of_the_environment_on_the_robot() -> None:
    joints = at_work((0.2, 0.0, 0.1))
    assert tip_force(arm_pose(joints), STILL, balanced(joints, (0.0, 0.0, 3.0)), NONE)[2] == pytest.approx(3.0)


@given(places, forces, signs, st.floats(-0.4, 0.4))
def test_friction_and_a_wrong_torque_constant_stay_within_the_stated_error(
    place: Vector, force: Vector, sticking: Joints, wrong: float
) -> None:
    joints = at_work(place)
    here, friction = arm_pose(joints), JointFriction()
    e, f, g, h = (part * coulomb for part, coulomb in zip(sticking, COULOMB_N_M, strict=True))
    a, b, c, d = (torque / (1.0 + wrong) for torque in balanced(joints, force, (e, f, g, h)))  # as the currents say
    felt = tip_force(here, STILL, (a, b, c, d), friction)
    newtons, share = force_error(here, friction, 0.4)
    assert distance(felt, force) <= newtons + share * norm(felt) + 1e-9


def test_the_stated_error_is_not_far_above_the_worst_case() -> None:
    joints = at_work((0.2, 0.05, 0.15))
    here, friction = arm_pose(joints), JointFriction()
    newtons, _ = force_error(here, friction, 0.0)
    corners = [
        tuple(coulomb if bits >> joint & 1 else -coulomb for joint, coulomb in enumerate(COULOMB_N_M))
        for bits in range(16)
    ]
    worst = max(norm(tip_force(here, STILL, balanced(joints, ZERO, (a, b, c, d)), friction)) for a, b, c, d in corners)
    assert newtons == pytest.approx(worst)


@given(places, forces, st.tuples(*[st.floats(0.06, 1.0)] * 4), st.tuples(*[st.sampled_from((-1.0, 1.0))] * 4))
def test_in_motion_the_friction_is_taken_out(place: Vector, force: Vector, speeds: Joints, ways: Joints) -> None:
    joints = at_work(place)
    a, b, c, d = (speed * way for speed, way in zip(speeds, ways, strict=True))
    e, f, g, h = (
        coulomb * way + viscous * speed * way
        for coulomb, viscous, speed, way in zip(COULOMB_N_M, VISCOUS_N_M_S, speeds, ways, strict=True)
    )
    felt = tip_force(arm_pose(joints), (a, b, c, d), balanced(joints, force, (e, f, g, h)), JointFriction())
    assert distance(felt, force) < 1e-9


@given(poses, st.tuples(*[st.floats(-0.05, 0.05)] * 4))
def test_where_a_direction_is_not_felt_a_small_torque_is_no_large_force(joints: Joints, noise: Joints) -> None:
    here = arm_pose(joints)
    a, b, c, d = (weight + each for weight, each in zip(here.gravity, noise, strict=True))
    felt = tip_force(here, STILL, (a, b, c, d), NONE)
    assert norm(felt) <= hypot(*noise) / 0.02 * 1.5


@pytest.mark.parametrize("tilt", [0.0, 1e-9, 1e-3, -0.05])
def test_an_arm_stretched_out_straight_feels_nothing_along_itself_and_says_no_nonsense(tilt: float) -> None:
    straight = pi / 2.0 - atan2(0.024, 0.128)
    here = arm_pose((0.4, straight, -straight + tilt, 0.0))
    a, b, c, d = (weight + 0.03 for weight in here.gravity)
    assert norm(tip_force(here, STILL, (a, b, c, d), NONE)) < 0.06 / 0.02


@given(poses, forces)
def test_near_such_a_posture_the_force_is_felt_too_small_never_too_large(joints: Joints, force: Vector) -> None:
    felt = tip_force(arm_pose(joints), STILL, balanced(joints, force), NONE)
    assert norm(felt) <= norm(force) + 1e-9


def test_the_filter_lags_a_slow_sine_as_stated_and_leaves_a_constant() -> None:
    low, period = ForceLowPass(20.0), 0.0005
    assert low.lag == pytest.approx(1.0 / (2.0 * pi * 20.0))
    worst = 0.0
    for step in range(4000):
        at = step * period
        x, _, _ = low.next((sin(2.0 * pi * at), 0.0, 0.0), at)
        if at > 1.0:
            worst = max(worst, abs(x - sin(2.0 * pi * (at - low.lag))))
    assert worst < 0.005
    for step in range(4000, 6000):
        settled = low.next((2.0, -1.0, 0.5), step * period)
    assert settled == pytest.approx((2.0, -1.0, 0.5))


def test_without_a_cutoff_nothing_is_filtered_and_a_restart_begins_at_once() -> None:
    assert ForceLowPass(0.0).lag == 0.0
    none = ForceLowPass(0.0)
    for at, force in enumerate([(1.0, 2.0, 3.0), (-4.0, 0.0, 1.0)]):
        assert none.next(force, float(at)) == force
    low = ForceLowPass(5.0)
    low.next((9.0, 9.0, 9.0), 0.0)
    low.restart()
    assert low.next(scale((1.0, 1.0, 1.0), 2.0), 0.001) == (2.0, 2.0, 2.0)
