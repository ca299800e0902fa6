"""Springs, dampers and what they may not do; stability near rest with a whole cycle of delay."""

from itertools import pairwise
from math import hypot

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.geometry.vector import ZERO, Vector, add, distance
from weberlink_arms.cartesian.arm import LOWER, UPPER, Joints, Mechanics, within_limits
from weberlink_arms.cartesian.impedance import LIMIT_MARGIN_RAD, ImpedanceGains, TipGoal, currents, joint_torques

POSE = Mechanics().pose
STILL: Joints = (0.0, 0.0, 0.0, 0.0)
poses = st.tuples(*[st.floats(low, high) for low, high in zip(LOWER, UPPER, strict=True)])
free = st.tuples(*[st.floats(low + 0.3, high - 0.3) for low, high in zip(LOWER, UPPER, strict=True)])
rates = st.tuples(*[st.floats(-2.0, 2.0)] * 4)
offsets = st.tuples(*[st.floats(-0.2, 0.2)] * 3)


def torque(joints: Joints, offset: Vector = ZERO, speeds: Joints = STILL, turn: float = 0.0) -> Joints:
    """Without the weight, for a goal at this offset from the tip [m] and a pitch to turn by [rad]."""
    here = POSE(joints)
    given_ = joint_torques(here, speeds, add(here.tip, offset), here.pitch + turn, ImpedanceGains())
    a, b, c, d = (tau - weight for tau, weight in zip(given_, here.gravity, strict=True))
    return (a, b, c, d)


@given(free, offsets)
def test_spring_force_is_bounded(joints: Joints, offset: Vector) -> None:
    stiffness = ImpedanceGains().stiffness
    stretched = stiffness * hypot(*offset)
    scale = stiffness * min(1.0, 5.0 / stretched) if stretched > 0.0 else 0.0
    x, y, z = offset
    wanted = POSE(joints).torques((scale * x, scale * y, scale * z))
    assert torque(joints, offset) == pytest.approx(wanted, abs=1e-9)


@given(free, rates)
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


@given(st.tuples(*[st.floats(-50.0, 50.0)] * 4), st.floats(0.1, 3.0))
def test_no_current_is_beyond_the_limit(torques: Joints, most: float) -> None:
    given_ = currents(torques, 1.78, most)
    for tau, amperes in zip(torques, given_, strict=True):
        assert abs(amperes) <= most
        assert amperes == pytest.approx(max(-most, min(most, tau / 1.78)))


HERE: Vector = (0.2, 0.0, 0.1)
THERE: Vector = (0.2, 0.0, 0.12)
PERIOD = 0.004


def run(goal: TipGoal, command: Vector | None, tip: Vector, begin: float, cycles: int) -> list[Vector]:
    return [goal.next(command, tip, begin + (number + 1) * PERIOD) for number in range(cycles)]


def test_first_command_is_approached_at_limited_speed() -> None:
    goal = TipGoal(0.1, 0.1)
    goal.place(HERE, 5.0)
    points = run(goal, THERE, HERE, 5.0, 60)
    assert not goal.holding
    for a, b in pairwise([HERE, *points]):
        assert distance(a, b) <= 0.1 * PERIOD + 1e-12
    assert points[40] != THERE
    assert points[-1] == THERE
    assert goal.next(HERE, HERE, 6.0) == HERE


def test_goal_holds_after_pause_and_resumes_smoothly() -> None:
    goal = TipGoal(0.1, 0.1)
    goal.place(HERE, 5.0)
    run(goal, THERE, HERE, 5.0, 60)
    pressed_at = (0.2, 0.0, 0.113)
    run(goal, None, pressed_at, 5.24, 30)
    assert goal.holding
    assert goal.next(None, (0.21, 0.0, 0.1), 5.4) == pressed_at, "where it was then, not where it drifts to"
    first = goal.next(THERE, pressed_at, 5.404)
    assert 0.0 < distance(first, pressed_at) <= 0.1 * PERIOD + 1e-12
