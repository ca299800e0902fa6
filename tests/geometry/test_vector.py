"""Lengths and sines: right for every number there is, and the same on every host that keeps IEEE 754."""

from math import cos, hypot, inf, isnan, nan, pi, sin, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.geometry.vector import ZERO, Vector, cosine, distance, norm, sine, unit

numbers = st.floats(allow_nan=False, allow_infinity=False)
close = st.floats(-1e-150, 1e-150)
edges = st.sampled_from([5e-324, -5e-324, 1e-200, 1e200, -1e200, 1.7e308, 1.0, 1e-170, 2.0**-450, 0.0])
vectors = st.tuples(numbers, numbers, numbers) | st.tuples(close, close, close) | st.tuples(edges, edges, edges)


@given(vectors)
@examples(500)
def test_a_length_is_that_of_the_library_to_2_units_in_the_last_place(vector: Vector) -> None:
    assert norm(vector) == pytest.approx(hypot(*vector), rel=5e-16, abs=5e-324)
    assert distance(vector, ZERO) == norm(vector)
    x, y, z = vector
    assert norm((x, 0.0, 0.0)) == norm((0.0, x, 0.0)) == norm((0.0, 0.0, x)) == abs(x)
    if 1e-250 < x * x + y * y + z * z < 1e300:
        assert norm(vector) == sqrt(x * x + y * y + z * z)
    if 1e-300 < norm(vector) < inf:
        assert norm(unit(vector)) == pytest.approx(1.0, rel=1e-15)


@pytest.mark.parametrize("axis", range(3))
def test_what_is_not_finite_has_no_finite_length(axis: int) -> None:
    assert norm(tuple(inf if each == axis else 1.0 for each in range(3))) == inf  # type: ignore[arg-type]
    assert isnan(norm(tuple(nan if each == axis else 1e300 for each in range(3))))  # type: ignore[arg-type]
    assert distance((inf, 0.0, 0.0), ZERO) == inf


folds = st.builds(
    lambda quarters, beside: 0.5 * pi * quarters + beside,
    st.integers(-9, 9),
    st.sampled_from([-1e-3, -1e-12, 0.0, 1e-12, 1e-3]),
)


@given(angle=st.floats(-1e6, 1e6) | st.floats(-10.0, 10.0) | folds)
def test_it_is_the_sine_of_the_library_to_a_billionth(angle: float) -> None:
    assert abs(sine(angle) - sin(angle)) <= 1e-9
    assert abs(cosine(angle) - cos(angle)) <= 1e-9


def test_near_zero_it_is_the_angle() -> None:
    assert sine(0.0) == 0.0
    assert sine(1e-8) == pytest.approx(1e-8, rel=1e-12)


@pytest.mark.parametrize(("angle", "expected"), [
    (0.1, "0x1.98eaecb8bcb2cp-4"), (1.0, "0x1.aed548f0927bdp-1"),
    (4.0, "-0x1.837b9dddc2167p-1"), (-1e5, "-0x1.24daa9c49ed83p-5"),
])  # fmt: skip
def test_every_host_gives_the_same_bits(angle: float, expected: str) -> None:
    """Sums and products, which IEEE 754 rounds in one way, in an order that must not change."""
    assert sine(angle).hex() == expected
