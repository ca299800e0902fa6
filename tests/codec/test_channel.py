"""Channels and the integers of their samples."""

from collections.abc import Callable
from functools import partial
from math import inf, isnan, nan
from operator import eq
from typing import Any

import pytest
from hypothesis import example, given, strategies as st

from tests.codec.law import make_channel
from weberlink.codec import force_channel, position_channel
from weberlink.codec.predictors import PREDICTORS, FitLimits
from weberlink.codec.rate import UpdateRate
from weberlink.codec.sample import Quantizer

values = st.floats(-30.0, 30.0)
anything = st.floats()
axes_sets = st.sampled_from(["xyz", "xz", "z"])


def test_only_the_named_predictors_are_in_the_bank() -> None:
    assert force_channel(predictor="plane").bank == ("plane",)
    assert force_channel(bank=["zoh", "sphere"]).bank == ("zoh", "sphere")
    assert force_channel(predictor="linear").predictors == (PREDICTORS["linear"],)
    assert force_channel(predictor="hybrid").bank == force_channel().bank == ("zoh", "linear", "plane", "sphere")
    assert position_channel(predictor="hybrid").bank == ("zoh", "linear")


OUT_OF_RANGE: list[tuple[Callable[..., Any], dict[str, Any], dict[str, list[Any]]]] = [
    (force_channel, {}, {"bank": [[], ["zoh", "zoh"], ["zoh", "spline"], ["hybrid"], list(PREDICTORS) * 2]}),
    (partial(make_channel, "zoh"), {}, {"lookahead": [-1], "smoothing": [-1], "tick_period": [0.0, nan, inf]}),
    (Quantizer, {"step": 1.0}, {"step": [0.0, -1.0, nan, inf], "axes": ["", "w", "zx", "xx"]}),
    (UpdateRate, {"per_tick": 0.1, "burst": 4.0}, {"per_tick": [0.0, -1.0, nan, inf], "burst": [3.9, inf]}),
    (FitLimits, {}, {"stiffness": [(5.0, 5.0)], "radius": [(0.0, 1.0)]}),
]
"""What is made, with what; and values of arguments that are beyond their range."""


@pytest.mark.parametrize(("make", "good", "beyond"), OUT_OF_RANGE)
def test_refuses_what_is_out_of_range_by_name(
    make: Callable[..., Any], good: dict[str, Any], beyond: dict[str, list[Any]]
) -> None:
    make(**good)
    for name, values in beyond.items():
        for bad in values:
            with pytest.raises(ValueError, match=name):
                make(**good | {name: bad})


@pytest.mark.parametrize("predictor", [name for name, each in PREDICTORS.items() if each.geometric])
def test_geometry_does_not_predict_positions(predictor: str) -> None:
    with pytest.raises(ValueError, match=predictor):
        position_channel(predictor=predictor)


BANK = ("zoh", "linear", "plane")
READS = [(3,), (3,), (3, 3)]


@pytest.mark.parametrize(
    ("options", "newest"),
    [
        ({}, READS),
        ({"every_position": True}, [(3, 3)] * 3),
        ({"smoothing": 10}, [(3, 3)] * 3),
        ({"smoothing": 10, "bank": BANK[:2]}, READS[:2]),
    ],
)
def test_an_update_carries_what_is_read(options: dict[str, Any], newest: list[tuple[int, ...]]) -> None:
    """By the predictor, by somebody beside it, or by the ramp, which begins at the value of any model before."""
    channel = make_channel("hybrid", **{"bank": BANK, **options})
    assert [form.newest for form in channel.forms] == newest
    assert [form.previous for form in channel.forms] == READS[: len(newest)]
    assert [form.newest for form in position_channel(predictor="hybrid").forms] == [(3,)] * 2


# Quantizers.


def test_values_saturate_at_the_wire_range() -> None:
    assert Quantizer(1e-3).limit == pytest.approx(32.767)
    assert Quantizer(1e-3).quantize((40.0, -40.0, 0.0))[0] == (32_767, -32_767, 0)
    # A level that no encoder sends counts as the limit.
    assert Quantizer(0.5).value((-32_768, 0, 99_999)) == (-16_383.5, 0.0, 16_383.5)


def test_only_the_named_axes_travel() -> None:
    quantizer = Quantizer(0.5, "xz")
    assert quantizer.size == 2
    assert quantizer.quantize((1.0, 7.0, 2.0)) == ((2, 4), (1.0, 0.0, 2.0))
    assert quantizer.value((2, 4)) == quantizer.confine((1.0, 7.0, 2.0)) == (1.0, 0.0, 2.0)
    x, y, z = quantizer.confine((nan, 3.0, inf))
    assert isnan(x)
    assert (y, z) == (0.0, 16_383.5)


def test_without_a_range_any_finite_value_has_a_level() -> None:
    quantizer = Quantizer(1e-12, largest_level=inf)
    assert quantizer.quantize((1e6, 0.0, -3.5))[1][0] == pytest.approx(1e6)
    assert quantizer.quantize((1e300, 0.0, -1e308))[1] == (quantizer.limit, 0.0, -quantizer.limit)


@given(
    value=st.tuples(*[values | st.floats(allow_nan=False, allow_infinity=False)] * 3),
    step=st.floats(1e-3, 1.0),
    axes=axes_sets,
)
def test_the_sender_rounds_by_half_a_step_to_what_its_levels_decode_to(
    value: tuple[float, float, float], step: float, axes: str
) -> None:
    for quantizer in (Quantizer(step, axes), Quantizer(1e-9, axes, largest_level=inf)):
        levels, rounded = quantizer.quantize(value)
        assert rounded == quantizer.value(levels)
        for original, decoded in zip(quantizer.confine(value), rounded, strict=True):
            assert abs(original - decoded) <= 0.5 * quantizer.step * (1.0 + 1e-9) + 1e-15 * abs(original)


@given(value=st.tuples(anything, anything, anything), axes=axes_sets)
@example((-1.0, 0.0, -32.0), "xz")
@example((32.0, -32.0, -1.0), "xyz")
def test_confine_keeps_exactly_what_the_wire_can_say(value: tuple[float, float, float], axes: str) -> None:
    for quantizer in (Quantizer(1e-3, axes), Quantizer(1e200, axes, largest_level=inf)):
        kept = all(map(eq, quantizer.confine(value), value))  # NaN is not equal to itself
        assert kept == all(
            low <= each <= high for low, each, high in zip(quantizer.lowest, value, quantizer.highest, strict=True)
        )
        if kept:
            assert all(component - component == 0.0 for component in value)
