from math import cos, inf, nan, pi, sin

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from weberlink.geometry.rotation import (
    IDENTITY,
    LONGEST,
    Quaternion,
    angle_between,
    negative,
    quaternion,
    toward,
    unit_quaternion,
    vector,
)
from weberlink.geometry.vector import ZERO, Vector, distance, norm, scale

EXACT = 1e-12
parts = st.floats(-1.0, 1.0)
lengths = st.one_of(st.just(0.0), st.floats(1e-160, 1e-7), st.floats(1e-7, pi))


@st.composite
def units(draw: st.DrawFn) -> Quaternion:
    made = unit_quaternion((draw(parts), draw(parts), draw(parts), draw(parts)))
    assume(made is not None)
    assert made is not None
    return made


@st.composite
def axes(draw: st.DrawFn) -> Vector:
    drawn = (draw(parts), draw(parts), draw(parts))
    assume(norm(drawn) > 1e-3)
    return scale(drawn, 1.0 / norm(drawn))


@given(units())
def test_a_rotation_survives_as_a_vector_of_at_most_half_a_turn(orientation: Quaternion) -> None:
    as_vector = vector(orientation)
    assert norm(as_vector) <= pi + EXACT
    assert angle_between(quaternion(as_vector), orientation) < 1e-7
    assert distance(vector(negative(orientation)), as_vector) < EXACT or norm(as_vector) == pytest.approx(pi)


@given(axes(), lengths)
def test_a_vector_of_at_most_half_a_turn_survives_as_a_rotation(axis: Vector, angle: float) -> None:
    rotation = scale(axis, angle)
    returned = vector(quaternion(rotation), rotation)
    assert distance(returned, rotation) <= EXACT


def test_a_turn_about_an_axis_is_what_it_says() -> None:
    w, x, y, z = quaternion((0.0, 0.0, pi / 2))
    assert (w, x, y, z) == pytest.approx((cos(pi / 4), 0.0, 0.0, sin(pi / 4)))
    assert quaternion(ZERO) == IDENTITY
    assert vector(IDENTITY) == ZERO


@given(axes(), axes(), st.floats(0.0, LONGEST), st.floats(0.0, LONGEST))
def test_two_rotations_are_no_farther_apart_than_their_vectors(a: Vector, b: Vector, one: float, other: float) -> None:
    """What makes a bound on the vectors one on the rotations."""
    first, second = scale(a, one), scale(b, other)
    assert angle_between(quaternion(first), quaternion(second)) <= distance(first, second) + 1e-9


@given(axes(), st.floats(0.0, 0.03))
def test_a_tremble_about_half_a_turn_does_not_jump(axis: Vector, amplitude: float) -> None:
    """The vector goes on beyond half a turn as long as the wire can say it."""
    near = scale(axis, pi)
    for step in range(200):
        angle = pi + amplitude * sin(0.1 * step)
        now = vector(quaternion(scale(axis, angle)), near)
        assert distance(now, near) <= 2.0 * amplitude + EXACT
        assert norm(now) <= LONGEST + EXACT
        near = now


@given(axes())
def test_a_turn_on_and_on_jumps_once_a_turn_to_the_same_rotation(axis: Vector) -> None:
    near, jumps = ZERO, 0
    for step in range(1, 2001):
        orientation = quaternion(scale(axis, 0.01 * step))
        now = vector(orientation, near)
        assert norm(now) <= LONGEST + EXACT
        assert angle_between(quaternion(now), orientation) < 1e-7
        jumps += distance(now, near) > 0.1
        near = now
    assert jumps == 3  # 20 rad


@given(units(), units(), st.floats(0.0, 4.0))
def test_the_way_from_one_to_another_is_the_shortest_and_no_longer_than_asked(
    start: Quaternion, goal: Quaternion, angle: float
) -> None:
    whole = angle_between(start, goal)
    reached = toward(start, goal, angle)
    if whole <= angle:
        assert reached == goal
    else:
        assert angle_between(start, reached) == pytest.approx(angle, abs=1e-7)
        assert angle_between(start, reached) + angle_between(reached, goal) == pytest.approx(whole, abs=1e-6)
    assert sum(part * part for part in reached) == pytest.approx(1.0)


@pytest.mark.parametrize("bad", [(nan, 0, 0, 0), (inf, 0, 0, 0), (0, 0, 0, 0), (1e-9, 0, 0, 0), (1, nan, 0, 0)])
def test_what_is_no_orientation_has_no_unit_quaternion(bad: Quaternion) -> None:
    assert unit_quaternion(bad) is None


@given(units(), st.floats(1e-3, 1e3))
def test_an_orientation_of_another_length_is_the_same(orientation: Quaternion, length: float) -> None:
    w, x, y, z = orientation
    made = unit_quaternion((w * length, x * length, y * length, z * length))
    assert made == pytest.approx(orientation)
