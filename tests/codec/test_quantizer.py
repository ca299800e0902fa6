from math import inf, isnan, nan
from operator import eq

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.codec.quantizer import Quantizer

values = st.floats(-30.0, 30.0)
anything = st.floats()


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


@given(
    value=st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3), axes=st.sampled_from(["xyz", "xz", "z"])
)
def test_a_value_is_rounded_to_what_its_levels_say(value: tuple[float, float, float], axes: str) -> None:
    for quantizer in (Quantizer(1e-3, axes), Quantizer(1e-9, axes, largest_level=inf)):
        assert quantizer.rounded(value) == quantizer.value(quantizer.levels(value))


@given(value=st.tuples(anything, anything, anything), axes=st.sampled_from(["xyz", "xz", "z"]))
def test_a_value_that_can_be_said_is_confined_to_itself(value: tuple[float, float, float], axes: str) -> None:
    for quantizer in (Quantizer(1e-3, axes), Quantizer(1e200, axes, largest_level=inf)):
        assert quantizer.says(value) == all(map(eq, quantizer.confine(value), value))
        if quantizer.says(value):
            assert all(component - component == 0.0 for component in value)
