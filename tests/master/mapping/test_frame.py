"""The map between frames: rotations are rotations, forces do the work that motion takes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.geometry.rotation import quaternion, turned, vector
from weberlink.geometry.vector import ZERO, Vector, add, dot, norm, scale, subtract, unit
from weberlink.master.mapping.mapped_device import FrameMap

small = st.floats(-1.0, 1.0)
vectors = st.tuples(small, small, small)
angles = st.tuples(*[st.floats(-360.0, 360.0)] * 3)
scales = st.floats(0.1, 10.0)


@examples(40)
@given(angles, scales, scales, vectors, vectors)
def test_lengths_scale_and_way_is_inverse(turn: Vector, s: float, f: float, a: Vector, b: Vector) -> None:
    frame = FrameMap(turn, s, f, (0.1, -0.2, 0.3))
    moved = subtract(frame.position(add(a, b)), frame.position(a))
    assert norm(moved) == pytest.approx(s * norm(b), abs=1e-12)
    assert frame.way(moved) == pytest.approx(b, abs=1e-12)


@examples(40)
@given(angles, scales, scales, vectors, vectors)
def test_power_scales_by_a_constant(turn: Vector, s: float, f: float, way: Vector, force: Vector) -> None:
    """Which is why a passive scene stays passive through the map: f_hand . v_hand = (f / s) f_robot . v_robot."""
    frame = FrameMap(turn, s, f, (0.0, 0.0, 0.0))
    assert dot(frame.force(force), way) == pytest.approx(f / s * dot(force, frame.position(way)), abs=1e-9)


def test_right_angles_are_exact() -> None:
    assert FrameMap((0, 0, 90), 1, 1, (0, 0, 0)).position((1.0, 2.0, 3.0)) == (-2.0, 1.0, 3.0)
    assert FrameMap((0, 0, 180), 1, 1, (0, 0, 0)).position((1.0, 2.0, 3.0)) == (-1.0, -2.0, 3.0)
    assert FrameMap((0, 0, -90), 1, 1, (0, 0, 0)).position((1.0, 2.0, 3.0)) == (2.0, -1.0, 3.0)
    assert FrameMap((90, 0, 0), 1, 1, (0, 0, 0)).position((1.0, 2.0, 3.0)) == (1.0, -3.0, 2.0)
    assert FrameMap((0, 90, 0), 1, 1, (0, 0, 0)).position((1.0, 2.0, 3.0)) == (3.0, 2.0, -1.0)
    assert FrameMap((90, 0, 90), 1, 1, (0, 0, 0)).position((0.0, 0.0, 1.0)) == (1.0, 0.0, 0.0)  # x first, then z


@examples(40)
@given(angles, scales, scales, vectors.filter(lambda axis: norm(axis) > 0.1), vectors, vectors)
def test_orientation_and_torque_turn_like_position_and_force(
    turn: Vector, s: float, f: float, axis: Vector, torque: Vector, v: Vector
) -> None:
    """A turn w of the hand is one of the tool by R w, and torque . w is kept but for the scale of the force."""
    frame, angle = FrameMap(turn, s, f, ZERO), 0.7
    w, handle = scale(unit(axis), angle), quaternion(scale(unit(axis), angle))
    tool = frame.orientation(handle)
    assert turned(tool, frame.position(v)) == pytest.approx(frame.position(turned(handle, v)), abs=1e-9)
    assert dot(frame.force(torque), w) == pytest.approx(f * dot(torque, vector(tool)), abs=1e-9)


@examples(40)
@given(angles, scales, vectors)
def test_the_box_holds_whatever_the_device_reaches(turn: Vector, s: float, inside: Vector) -> None:
    frame = FrameMap(turn, s, 1.0, (0.5, 0.0, -0.5))
    low, high = frame.box(((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)))
    point = frame.position(inside)
    assert all(a - 1e-9 <= p <= b + 1e-9 for a, p, b in zip(low, point, high, strict=True))
