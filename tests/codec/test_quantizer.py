from math import inf, isnan, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.quantizer import Quantizer

values = st.floats(-30.0, 30.0)


@given(value=st.tuples(values, values, values), step=st.floats(1e-3, 1.0))
def test_round_trip_is_within_half_a_step(value: tuple[float, float, float], step: float) -> None:
    quantizer = Quantizer(step)
    for original, decoded in zip(value, quantizer.value(quantizer.levels(value)), strict=True):
        assert abs(original - decoded) <= 0.5 * step * (1.0 + 1e-9)


@given(levels=st.tuples(*[st.integers(-32_767, 32_767)] * 3))
def test_levels_are_fixed_points(levels: tuple[int, int, int]) -> None:
    quantizer = Quantizer(1e-5)
    assert quantizer.levels(quantizer.value(levels)) == levels


def test_saturates_at_the_wire_range_and_says_where_it_is() -> None:
    quantizer = Quantizer(1e-3)
    assert quantizer.limit == pytest.approx(32.767)
    assert quantizer.levels((40.0, -40.0, 0.0)) == (32_767, -32_767, 0)


def test_only_the_named_axes_travel() -> None:
    quantizer = Quantizer(0.5, "xz")
    assert quantizer.size == 2
    assert quantizer.levels((1.0, 7.0, 2.0)) == (2, 4)
    assert quantizer.value((2, 4)) == (1.0, 0.0, 2.0)
    assert quantizer.confine((1.0, 7.0, 2.0)) == (1.0, 0.0, 2.0)


def test_without_a_range_any_finite_value_has_a_level() -> None:
    quantizer = Quantizer(1e-12, largest_level=inf)
    assert quantizer.value(quantizer.levels((1e6, 0.0, -3.5)))[0] == pytest.approx(1e6)
    assert quantizer.value(quantizer.levels((1e300, 0.0, -1e308))) == (quantizer.limit, 0.0, -quantizer.limit)


def test_a_level_that_no_encoder_sends_counts_as_the_limit() -> None:
    assert Quantizer(0.5).value((-32_768, 0, 99_999)) == (-16_383.5, 0.0, 16_383.5)


def test_what_is_no_number_stays_so_on_the_axes_that_travel() -> None:
    x, y, z = Quantizer(0.5, "xz").confine((nan, 3.0, inf))
    assert isnan(x)
    assert (y, z) == (0.0, 16_383.5)


@pytest.mark.parametrize("step", [0.0, -1.0, nan, inf])
def test_refuses_a_step_that_is_none(step: float) -> None:
    with pytest.raises(ValueError, match="step"):
        Quantizer(step)


@pytest.mark.parametrize("axes", ["", "w", "zx", "xx"])
def test_refuses_axes_that_are_none(axes: str) -> None:
    with pytest.raises(ValueError, match="axes"):
        Quantizer(1.0, axes)
