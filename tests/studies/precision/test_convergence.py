"""The fit of an order, on errors whose order is known."""

from math import exp, inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.studies.precision.convergence import fitted_order

STEPS = [2.0**-n for n in range(12)]


@given(st.floats(0.5, 6.0), st.floats(1e-3, 1e3))
def test_a_power_law_gives_its_power(order: float, constant: float) -> None:
    errors = [constant * step**order for step in STEPS]
    fitted = fitted_order(STEPS, errors, 1e-15)
    usable = sum(1e-15 < error < 0.03 for error in errors)
    assert (fitted is None) == (usable < 3)
    if fitted is not None:
        assert fitted == pytest.approx(order, abs=1e-6)


@pytest.mark.parametrize(("gain", "order"), [(lambda z: 1.0 - z, 1), (lambda z: (1.0 - z / 2.0) / (1.0 + z / 2.0), 2)])
def test_euler_and_trapezoidal_rule_show_their_orders(gain: object, order: int) -> None:
    """x' = -x over 1 s."""
    counts = [2**n for n in range(2, 10)]
    errors = [abs(gain(1.0 / count) ** count - exp(-1.0)) for count in counts]  # type: ignore[operator]
    assert fitted_order([1.0 / count for count in counts], errors, 1e-12) == pytest.approx(order, abs=0.05)


def test_what_is_coarse_diverged_or_rounding_does_not_count() -> None:
    errors: list[float | None] = [None, 5.0, 0.9, *[0.02 * 4.0**-n for n in range(4)], *[1e-13] * 5]
    assert fitted_order(STEPS, errors, 1e-12) == pytest.approx(2.0)
    assert fitted_order(STEPS, [None, inf, *[1e-14] * 10], 1e-12) is None


def test_the_order_of_the_steps_does_not_matter() -> None:
    errors = [0.02 * step**2 for step in STEPS]
    assert fitted_order(STEPS[::-1], errors[::-1], 1e-12) == pytest.approx(fitted_order(STEPS, errors, 1e-12))
