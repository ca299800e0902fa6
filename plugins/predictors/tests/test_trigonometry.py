"""Sine and cosine: those of the library, and the same on every host that keeps IEEE 754."""

from math import cos, pi, sin

import pytest
from hypothesis import given, strategies as st

from weberlink_predictors.trigonometry import cosine, sine

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
