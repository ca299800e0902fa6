"""The pose of the arm is that of its model, and the inverse leads there."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.geometry.vector import Vector, distance
from weberlink_arms.cartesian.arm import LOWER, UPPER, Joints, Mechanics, inverse, inverse_nearest, within_limits
from weberlink_mujoco.arms.models import load

POSE = Mechanics().pose
MODEL = load("open_manipulator_x")
poses = st.tuples(*[st.floats(low, high) for low, high in zip(LOWER, UPPER, strict=True)])


@given(poses, st.tuples(*[st.floats(-5.0, 5.0)] * 3), st.tuples(*[st.floats(-2.0, 2.0)] * 4))
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


@given(st.tuples(st.floats(0.12, 0.26), st.floats(-0.12, 0.12), st.floats(0.05, 0.25)), st.floats(0.0, 1.2))
def test_the_inverse_leads_where_it_was_asked_to(tip: Vector, pitch: float) -> None:
    joints = inverse_nearest(tip, pitch)
    assert joints is not None, "the default workspace is within reach"
    assert within_limits(joints)
    assert distance(POSE(joints).tip, tip) < 1e-9
    exact = inverse(tip, pitch)
    if exact is not None:
        assert POSE(joints).pitch == pytest.approx(pitch, abs=1e-9)
