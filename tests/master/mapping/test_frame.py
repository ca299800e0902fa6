"""The map between frames: rotations are rotations, forces do the work that motion takes."""

from math import cos, radians, sin, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.vector import Vector, add, dot, norm, scale, subtract
from master.mapping import FrameMap

small = st.floats(-1.0, 1.0)
vectors = st.tuples(small, small, small)
angles = st.tuples(*[st.floats(-360.0, 360.0)] * 3)
scales = st.floats(0.1, 10.0)


@given(angles, scales, scales, vectors, vectors)
def test_lengths_scale_and_the_way_back_is_the_inverse(turn: Vector, s: float, f: float, a: Vector, b: Vector) -> None:
    frame = FrameMap(turn, s, f, (0.1, -0.2, 0.3))
    moved = subtract(frame.position(add(a, b)), frame.position(a))
    assert norm(moved) == pytest.approx(s * norm(b), abs=1e-12)
    assert frame.way(moved) == pytest.approx(b, abs=1e-12)


@given(angles, scales, scales, vectors, vectors)
def test_power_at_the_hand_is_that_at_the_robot_times_a_constant(
    turn: Vector, s: float, f: float, way: Vector, force: Vector
) -> None:
    """Which is why a passive scene stays passive through the map: f_hand . v_hand = (f / s) f_robot . v_robot."""
    frame = FrameMap(turn, s, f, (0.0, 0.0, 0.0))
    assert dot(frame.force(force), way) == pytest.approx(f / s * dot(force, frame.position(way)), abs=1e-9)


def test_right_angles_are_exact_and_in_the_stated_order() -> None:
    assert FrameMap((0, 0, 90), 1, 1, (0, 0, 0)).position((1.0, 2.0, 3.0)) == (-2.0, 1.0, 3.0)
    assert FrameMap((90, 0, 0), 1, 1, (0, 0, 0)).position((1.0, 2.0, 3.0)) == (1.0, -3.0, 2.0)
    assert FrameMap((0, 90, 0), 1, 1, (0, 0, 0)).position((1.0, 2.0, 3.0)) == (3.0, 2.0, -1.0)
    assert FrameMap((90, 0, 90), 1, 1, (0, 0, 0)).position((0.0, 0.0, 1.0)) == (1.0, 0.0, 0.0)  # x first, then z


@given(angles, vectors)
def test_the_orientation_turns_like_the_position(turn: Vector, v: Vector) -> None:
    frame = FrameMap(turn, 1.0, 1.0, (0.0, 0.0, 0.0))
    handle = (cos(radians(20)), 0.0, sin(radians(20)), 0.0)  # 40 degrees about y, in the device's frame
    assert turned(frame.orientation(handle), v) == pytest.approx(frame.position(turned(handle, v)), abs=1e-9)
    assert sqrt(sum(part * part for part in frame.orientation(handle))) == pytest.approx(1.0)


def turned(q: tuple[float, float, float, float], v: Vector) -> Vector:
    """v + 2 w (u x v) + 2 u x (u x v)."""
    w, u = q[0], q[1:]
    once = cross(u, v)
    return add(v, add(scale(once, 2.0 * w), scale(cross(u, once), 2.0)))


def cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@given(angles, scales, vectors)
def test_the_box_holds_whatever_the_device_reaches(turn: Vector, s: float, inside: Vector) -> None:
    frame = FrameMap(turn, s, 1.0, (0.5, 0.0, -0.5))
    low, high = frame.box(((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)))
    point = frame.position(inside)
    assert all(a - 1e-9 <= p <= b + 1e-9 for a, p, b in zip(low, point, high, strict=True))


def test_a_planar_device_moves_the_axes_that_it_is_turned_to() -> None:
    assert FrameMap((0, 0, 0), 1, 1, (0, 0, 0)).axes("xy") == "xy"
    assert FrameMap((90, 0, 0), 1, 1, (0, 0, 0)).axes("xy") == "xz"
    assert FrameMap((45, 0, 0), 1, 1, (0, 0, 0)).axes("xy") == "xyz"
    assert FrameMap((0, 0, 90), 1, 1, (0, 0, 0)).axes("z") == "z"
