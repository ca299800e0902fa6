"""Lengths: right for every number there is, and the same on every host that keeps IEEE 754."""

from math import hypot, inf, isnan, nan, sqrt

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.geometry.vector import ZERO, Vector, distance, norm, unit

numbers = st.floats(allow_nan=False, allow_infinity=False)
close = st.floats(-1e-150, 1e-150)
vectors = st.tuples(numbers, numbers, numbers) | st.tuples(close, close, close)


@given(vectors)
@example((1e-200, 1e-200, 1e-200))
@example((5e-324, 0.0, 0.0))
@example((5e-324, -5e-324, 5e-324))
@example((1e200, -1e200, 1e200))
@example((1.7e308, 0.0, 0.0))
@example((1.7e308, 1.7e308, 1.7e308))
@example((1.0, 1e-170, 0.0))
@example((2.0**-450, 2.0**-450, 0.0))
@examples(1000)
def test_a_length_is_that_of_the_library_to_2_units_in_the_last_place(vector: Vector) -> None:
    expected = hypot(*vector)
    assert norm(vector) == pytest.approx(expected, rel=5e-16, abs=5e-324)
    assert distance(vector, ZERO) == norm(vector)


@given(numbers)
def test_along_an_axis_a_length_is_exact(component: float) -> None:
    assert norm((component, 0.0, 0.0)) == norm((0.0, component, 0.0)) == norm((0.0, 0.0, component)) == abs(component)


@given(vectors)
def test_where_nothing_can_go_wrong_it_is_the_plain_formula(vector: Vector) -> None:
    x, y, z = vector
    square = x * x + y * y + z * z
    if 1e-250 < square < 1e300:
        assert norm(vector) == sqrt(square)


@given(vectors.filter(lambda vector: vector != ZERO))
def test_a_direction_has_length_1(vector: Vector) -> None:
    if norm(vector) > 1e-300 and norm(vector) < inf:
        assert norm(unit(vector)) == pytest.approx(1.0, rel=1e-15)


def test_what_is_not_finite_has_no_finite_length() -> None:
    for at in range(3):
        assert norm(tuple(inf if axis == at else 1.0 for axis in range(3))) == inf  # type: ignore[arg-type]
        assert isnan(norm(tuple(nan if axis == at else 1e300 for axis in range(3))))  # type: ignore[arg-type]
    assert distance((inf, 0.0, 0.0), ZERO) == inf
