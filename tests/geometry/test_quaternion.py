"""Quaternions against the rotation matrix that is written out here."""

from math import sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.geometry.rotation import IDENTITY, Quaternion, inverse, product, turned
from weberlink.geometry.vector import Vector, dot, norm

part = st.floats(-1.0, 1.0)


def of_length_one(q: Quaternion) -> Quaternion:
    length = sqrt(sum(a * a for a in q))
    return (q[0] / length, q[1] / length, q[2] / length, q[3] / length)


orientations = st.tuples(part, part, part, part).filter(lambda q: sum(a * a for a in q) > 1e-2).map(of_length_one)
vectors = st.tuples(*[st.floats(-10.0, 10.0)] * 3)


def matrix(q: Quaternion) -> tuple[Vector, Vector, Vector]:
    w, x, y, z = q
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def by_matrix(q: Quaternion, v: Vector) -> Vector:
    a, b, c = matrix(q)
    return (dot(a, v), dot(b, v), dot(c, v))


@given(orientations, vectors)
def test_it_turns_as_the_matrix_does(q: Quaternion, v: Vector) -> None:
    assert turned(q, v) == pytest.approx(by_matrix(q, v), abs=1e-12)
    assert norm(turned(q, v)) == pytest.approx(norm(v), abs=1e-12)


@given(orientations, orientations, vectors)
def test_a_product_is_the_right_one_first(a: Quaternion, b: Quaternion, v: Vector) -> None:
    assert turned(product(a, b), v) == pytest.approx(by_matrix(a, by_matrix(b, v)), abs=1e-11)


@given(orientations)
def test_the_inverse_leads_back(q: Quaternion) -> None:
    assert product(q, inverse(q)) == pytest.approx(IDENTITY, abs=1e-12)
    assert product(inverse(q), q) == pytest.approx(IDENTITY, abs=1e-12)


def test_a_quarter_turn_about_each_axis_is_right_handed() -> None:
    half = sqrt(0.5)
    assert turned((half, half, 0.0, 0.0), (0.0, 1.0, 0.0)) == pytest.approx((0.0, 0.0, 1.0))
    assert turned((half, 0.0, half, 0.0), (0.0, 0.0, 1.0)) == pytest.approx((1.0, 0.0, 0.0))
    assert turned((half, 0.0, 0.0, half), (1.0, 0.0, 0.0)) == pytest.approx((0.0, 1.0, 0.0))
