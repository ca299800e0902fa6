"""Quaternions against the rotation matrix written out here, and rotation vectors."""

from math import inf, nan, pi, sin, sqrt

import pytest
from hypothesis import given, strategies as st

from tests.examples import examples
from weberlink.geometry.rotation import (
    IDENTITY,
    LONGEST,
    Quaternion,
    angle_between,
    inverse,
    negative,
    product,
    quaternion,
    toward,
    turned,
    unit_quaternion,
    vector,
)
from weberlink.geometry.vector import ZERO, Vector, distance, dot, norm, scale, unit

EXACT = 1e-12
triples = st.tuples(*[st.floats(-1.0, 1.0)] * 3)
axes = triples.filter(lambda drawn: norm(drawn) > 1e-3).map(unit)
units = st.tuples(st.floats(-1.0, 1.0), triples).map(lambda drawn: unit_quaternion((drawn[0], *drawn[1]))).filter(bool)
vectors = st.tuples(*[st.floats(-10.0, 10.0)] * 3)
lengths = st.one_of(st.just(0.0), st.floats(1e-160, 1e-7), st.floats(1e-7, pi))


def by_matrix(q: Quaternion, v: Vector) -> Vector:
    w, x, y, z = q
    return (
        dot((1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)), v),
        dot((2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)), v),
        dot((2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)), v),
    )


@given(units, units, vectors)
def test_quaternions_turn_compose_and_invert_as_matrices_do(a: Quaternion, b: Quaternion, v: Vector) -> None:
    assert turned(a, v) == pytest.approx(by_matrix(a, v), abs=EXACT)
    assert norm(turned(a, v)) == pytest.approx(norm(v), abs=EXACT)
    assert turned(product(a, b), v) == pytest.approx(by_matrix(a, by_matrix(b, v)), abs=1e-11)
    assert product(a, inverse(a)) == pytest.approx(IDENTITY, abs=EXACT)
    assert product(inverse(a), a) == pytest.approx(IDENTITY, abs=EXACT)


@pytest.mark.parametrize("axis", range(3))
def test_a_quarter_turn_about_each_axis_is_right_handed(axis: int) -> None:
    basis = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    half, second, third = sqrt(0.5), basis[(axis + 1) % 3], basis[(axis + 2) % 3]
    quarter = quaternion(scale(basis[axis], 0.5 * pi))
    assert quarter == pytest.approx((half, *scale(basis[axis], half)))
    assert turned(quarter, second) == pytest.approx(third)
    assert (quaternion(ZERO), vector(IDENTITY)) == (IDENTITY, ZERO)


@given(units, axes, lengths)
def test_a_rotation_survives_as_a_vector_and_a_vector_as_a_rotation(
    orientation: Quaternion, axis: Vector, angle: float
) -> None:
    as_vector = vector(orientation)
    assert norm(as_vector) <= pi + EXACT
    assert angle_between(quaternion(as_vector), orientation) < 1e-7
    assert distance(vector(negative(orientation)), as_vector) < EXACT or norm(as_vector) == pytest.approx(pi)
    rotation = scale(axis, angle)
    assert distance(vector(quaternion(rotation), rotation), rotation) <= EXACT


@given(axes, axes, st.floats(0.0, LONGEST), st.floats(0.0, LONGEST))
def test_two_rotations_differ_by_at_most_the_distance_of_their_vectors(
    a: Vector, b: Vector, one: float, other: float
) -> None:
    """So that a bound on the vectors bounds the rotations."""
    first, second = scale(a, one), scale(b, other)
    assert angle_between(quaternion(first), quaternion(second)) <= distance(first, second) + 1e-9


@given(axes, st.floats(0.0, 0.03))
@examples(20)
def test_a_tremor_about_half_a_turn_does_not_jump(axis: Vector, amplitude: float) -> None:
    """The vector goes on beyond half a turn as long as the wire can say it."""
    near = scale(axis, pi)
    for step in range(200):
        now = vector(quaternion(scale(axis, pi + amplitude * sin(0.1 * step))), near)
        assert distance(now, near) <= 2.0 * amplitude + EXACT
        assert norm(now) <= LONGEST + EXACT
        near = now


@given(axes)
@examples(20)
def test_a_continued_turn_jumps_once_a_turn_to_the_same_rotation(axis: Vector) -> None:
    near, jumps = ZERO, 0
    for step in range(1, 2001):
        orientation = quaternion(scale(axis, 0.01 * step))
        now = vector(orientation, near)
        assert norm(now) <= LONGEST + EXACT
        assert angle_between(quaternion(now), orientation) < 1e-7
        jumps += distance(now, near) > 0.1
        near = now
    assert jumps == 3  # 20 rad


@given(units, units, st.floats(0.0, 4.0))
def test_toward_takes_the_shortest_way_no_longer_than_asked(start: Quaternion, goal: Quaternion, angle: float) -> None:
    whole = angle_between(start, goal)
    reached = toward(start, goal, angle)
    if whole <= angle:
        assert reached == goal
    else:
        assert angle_between(start, reached) == pytest.approx(angle, abs=1e-7)
        assert angle_between(start, reached) + angle_between(reached, goal) == pytest.approx(whole, abs=1e-6)
    assert sum(part * part for part in reached) == pytest.approx(1.0)


@given(units, st.floats(1e-3, 1e3))
def test_unit_quaternion_scales_and_refuses_what_has_no_length(orientation: Quaternion, length: float) -> None:
    w, x, y, z = orientation
    assert unit_quaternion((w * length, x * length, y * length, z * length)) == pytest.approx(orientation)
    for bad in ((nan, 0, 0, 0), (inf, 0, 0, 0), (0, 0, 0, 0), (1e-9, 0, 0, 0), (1, nan, 0, 0)):
        assert unit_quaternion(bad) is None
