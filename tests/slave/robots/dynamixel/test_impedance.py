"""Springs, dampers and what they may not do; stability near rest with a whole cycle of delay."""

from math import hypot

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.vector import ZERO, Vector, add
from slave.robots.dynamixel.arm import LOWER, UPPER, Joints, posture, within_limits
from slave.robots.dynamixel.impedance import (
    LIMIT_MARGIN_RAD,
    SLOWEST_HZ,
    Gains,
    currents,
    joint_torques,
    null_direction,
    stiffest,
)
from tests.slave.robots.dynamixel.stability import largest_eigenvalue, workspace

STILL: Joints = (0.0, 0.0, 0.0, 0.0)
poses = st.tuples(*[st.floats(low, high) for low, high in zip(LOWER, UPPER, strict=True)])
free = st.tuples(*[st.floats(low + 0.3, high - 0.3) for low, high in zip(LOWER, UPPER, strict=True)])
rates = st.tuples(*[st.floats(-2.0, 2.0)] * 4)
offsets = st.tuples(*[st.floats(-0.2, 0.2)] * 3)
AT_WORK: Joints = (0.3, -0.4, 0.5, 0.6)


def torque(joints: Joints, offset: Vector = ZERO, speeds: Joints = STILL, turn: float = 0.0) -> Joints:
    """Without the weight, for a goal at this offset from the tip [m] and a pitch to turn by [rad]."""
    here = posture(joints)
    given_ = joint_torques(here, speeds, add(here.tip, offset), here.pitch + turn, Gains())
    a, b, c, d = (tau - weight for tau, weight in zip(given_, here.gravity, strict=True))
    return (a, b, c, d)


@given(free)
def test_at_its_goal_the_arm_is_held_against_its_weight_and_no_more(joints: Joints) -> None:
    assert torque(joints) == pytest.approx(STILL, abs=1e-12)


@given(free, offsets)
def test_the_tip_is_pulled_to_its_goal_by_a_bounded_spring(joints: Joints, offset: Vector) -> None:
    stretched = 200.0 * hypot(*offset)
    scale = 200.0 * min(1.0, 5.0 / stretched) if stretched > 0.0 else 0.0
    x, y, z = offset
    wanted = posture(joints).torques((scale * x, scale * y, scale * z))
    assert torque(joints, offset) == pytest.approx(wanted, abs=1e-9)


@given(free, rates)
def test_the_damper_only_takes_energy(joints: Joints, speeds: Joints) -> None:
    power = sum(tau * rate for tau, rate in zip(torque(joints, ZERO, speeds), speeds, strict=True))
    assert power <= 0.0
    energy = 0.5 * sum(p * rate for p, rate in zip(posture(joints).momentum(speeds), speeds, strict=True))
    assert power == pytest.approx(-2.0 * 50.0 * energy, abs=1e-9), "all motion dies away at the same rate"


@given(free, st.floats(-1.0, 1.0))
def test_the_pitch_is_turned_without_a_force_on_the_tip(joints: Joints, turn: float) -> None:
    here = posture(joints)
    null = null_direction(here)
    motion = (0.0, *null)
    assert hypot(*here.velocity(motion)) < 1e-12
    turning = torque(joints, ZERO, STILL, turn)
    for row in here.jacobian():  # a tip that is held feels J^T f only, to which n is at right angles
        pressing = sum(j * n for j, n in zip(row, motion, strict=True))
        assert pressing == pytest.approx(0.0, abs=1e-12)
    along = sum(tau * n for tau, n in zip(turning, motion, strict=True))
    assert turning == pytest.approx(tuple(along * n for n in motion), abs=1e-12)
    assert along * sum(null) * turn >= -1e-12, "towards the pitch that is wanted"


def test_an_arm_stretched_out_straight_has_no_motion_of_its_own() -> None:
    straight = posture(
        (0.0, float(np.pi / 2 - np.arctan2(0.024, 0.128)), -float(np.pi / 2 - np.arctan2(0.024, 0.128)), 0.0)
    )
    assert null_direction(straight) == (0.0, 0.0, 0.0)


@given(poses)
def test_near_a_limit_a_spring_pushes_back_and_elsewhere_none_does(joints: Joints) -> None:
    pushing = torque(joints)
    if within_limits(joints, LIMIT_MARGIN_RAD):
        assert pushing == pytest.approx(STILL, abs=1e-12)
    for q, low, high, tau in zip(joints, LOWER, UPPER, pushing, strict=True):
        if q < low + LIMIT_MARGIN_RAD - 1e-6:
            assert tau > 0.0
        elif q > high - LIMIT_MARGIN_RAD + 1e-6:
            assert tau < 0.0


@given(st.tuples(*[st.floats(-50.0, 50.0)] * 4), st.floats(0.1, 3.0))
def test_no_current_is_beyond_the_limit(torques: Joints, most: float) -> None:
    given_ = currents(torques, 1.78, most)
    for tau, amperes in zip(torques, given_, strict=True):
        assert abs(amperes) <= most
        assert amperes == pytest.approx(max(-most, min(most, tau / 1.78)))


@pytest.mark.parametrize(("rate", "damping"), [(250.0, 50.0), (SLOWEST_HZ, 50.0), (250.0, 30.0), (400.0, 100.0)])
def test_up_to_its_bound_it_is_stable_all_over_the_workspace(rate: float, damping: float) -> None:
    gains = Gains(stiffest(damping, rate), damping)
    for joints in workspace():
        assert largest_eigenvalue(joints, gains, 1.0 / rate) < 1.0, "in free space, without any friction"
        assert largest_eigenvalue(joints, gains, 1.0 / rate, viscous=1.0, wall=2000.0) < 1.0
        assert largest_eigenvalue(joints, gains, 1.0 / rate, rotor=0.005, wall=2000.0) < 1.0


def test_the_bound_is_near_where_it_swings_up() -> None:
    gains = Gains(2.0 * stiffest(50.0, 250.0), 50.0)
    assert max(largest_eigenvalue(joints, gains, 1.0 / 250.0) for joints in workspace()) > 1.02


def test_the_defaults_are_within_the_bound() -> None:
    gains = Gains()
    assert gains.stiffness <= stiffest(gains.damping_rate, 250.0)
