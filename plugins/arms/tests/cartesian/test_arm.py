"""Mechanics against numerical differentiation, round trips, energy and the emulated arm, which was written apart."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.geometry.vector import Vector, distance
from weberlink_arms.cartesian.arm import (
    LOWER,
    UPPER,
    Joints,
    arm_pose,
    inverse,
    inverse_nearest,
    within_limits,
)

STEP = 1e-6
poses = st.tuples(*[st.floats(low, high) for low, high in zip(LOWER, UPPER, strict=True)])


def moved(joints: Joints, index: int, by: float) -> Joints:
    a, b, c, d = (q + by * (number == index) for number, q in enumerate(joints))
    return (a, b, c, d)


@given(poses)
def test_the_jacobian_is_the_derivative_of_the_tip(joints: Joints) -> None:
    rows = arm_pose(joints).jacobian()
    for index in range(4):
        ahead, behind = (arm_pose(moved(joints, index, by)).tip for by in (STEP, -STEP))
        for row, a, b in zip(rows, ahead, behind, strict=True):
            assert row[index] == pytest.approx((a - b) / (2.0 * STEP), abs=1e-6)


@given(st.tuples(st.floats(0.12, 0.26), st.floats(-0.12, 0.12), st.floats(0.05, 0.25)), st.floats(0.0, 1.2))
def test_the_inverse_leads_where_it_was_asked_to(tip: Vector, pitch: float) -> None:
    joints = inverse_nearest(tip, pitch)
    assert joints is not None, "the default workspace is within reach"
    assert within_limits(joints)
    assert distance(arm_pose(joints).tip, tip) < 1e-9
    exact = inverse(tip, pitch)
    if exact is not None:
        assert arm_pose(joints).pitch == pytest.approx(pitch, abs=1e-9)
