"""A line that begins near its sample: its rounding on the wire, and the sender's filters."""

from collections.abc import Sequence
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.codec import Decoder, Update, force_channel, position_channel
from weberlink.codec.predictors.contract import EncodeContext, History
from weberlink.codec.predictors.model import Line
from weberlink.codec.predictors.trend import FINEST, HOLD_20, LAGS, LINE_40, NEAREST, SLOWEST, TREND, TrendFilter
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector, add, distance, norm, scale, subtract

steps = st.floats(-400.0, 400.0)
rates = st.floats(-20.0, 20.0)
filters = pytest.mark.parametrize("trend", [HOLD_20, LINE_40])


@pytest.mark.parametrize("axes", ["z", "xz", "xyz"])
@given(offset=st.tuples(steps, steps, steps), slope=st.tuples(rates, rates, rates))
@examples(50)
def test_a_line_survives_the_wire_towards_the_sample(axes: str, offset: Vector, slope: Vector) -> None:
    """Within 1/64 of the largest component, or a last bit of 1/16 of a wire step."""
    for channel in (force_channel(predictor="trend", axes=axes), position_channel(predictor="trend", axes=axes)):
        grid, quantizer, decoder = channel.grid, channel.value_quantizer, Decoder(channel)
        used, step = (lambda v, q=quantizer: q.vector(q.components(v))), quantizer.step
        levels = tuple(range(7, 7 + len(axes)))
        newest = grid.sample(40, levels)
        line = Line(add(newest.value, scale(used(offset), step)), scale(used(slope), step), 40)
        decoder.apply(Update(40, 0, levels, TREND.packed(line, newest, grid)))
        decoded = decoder.model
        assert isinstance(decoded, Line)
        assert decoded.tick == 40
        near, meant = subtract(decoded.value, newest.value), subtract(line.value, newest.value)
        for one, other in zip(near, meant, strict=True):
            assert abs(one) <= abs(other) + 1e-12
            assert abs(one - other) <= max(FINEST * step, 2.0**-6 * max(map(abs, meant))) * (1.0 + 1e-6)
        for one, other in zip(decoded.slope, line.slope, strict=True):
            assert abs(one - other) <= max(SLOWEST * step, 2.0**-6 * max(map(abs, line.slope))) * (1.0 + 1e-6)


def test_at_the_tick_of_the_sample_the_line_begins_beside_it() -> None:
    channel = force_channel(predictor="trend", axes="z")
    decoder, newest = Decoder(channel), channel.grid.sample(3, (1000,))
    line = Line((0.0, 0.0, 1.0625), (0.0, 0.0, -(2.0**-8)), 3)
    decoder.apply(Update(3, 0, (1000,), TREND.packed(line, newest, channel.grid)))
    assert decoder.value(3) == pytest.approx((0.0, 0.0, 1.0625), abs=1e-3)
    assert decoder.value(19) == pytest.approx((0.0, 0.0, 1.0), abs=1e-3)


def line_of(trend: TrendFilter, values: Sequence[Vector], bound: float = 1e9, rounding: Vector = ZERO) -> Line | None:
    history = History()
    for tick, value in enumerate(values):
        history.add(tick, value, ZERO)
    newest = Sample(len(values) - 1, add(values[-1], rounding), ZERO)
    return trend.model(EncodeContext(newest, None, bound, history))


@filters
def test_a_constant_is_held_and_one_sample_gives_no_line(trend: TrendFilter) -> None:
    assert line_of(trend, [(1.0, 2.0, 3.0)] * 50, 0.3) == Line((1.0, 2.0, 3.0), ZERO, 49)
    assert line_of(trend, [(1.0, 2.0, 3.0)]) is None


@filters
def test_it_is_linear_in_the_signal(trend: TrendFilter) -> None:
    values = [(0.01 * tick, -0.02 * tick, 0.001 * tick * tick) for tick in range(40)]
    line, double = line_of(trend, values), line_of(trend, [scale(value, 2.0) for value in values])
    assert double.value == pytest.approx(scale(line.value, 2.0))
    assert double.slope == pytest.approx(scale(line.slope, 2.0))
    # The earliest sample stands for those before it.
    padded = [values[0]] * (LAGS[-1] - 4) + values[:5]
    assert line_of(trend, values[:5]) == replace(line_of(trend, padded), tick=4)


def test_a_ramp_goes_on() -> None:
    """The regressions favour rest: only part of a slope continues."""
    line = line_of(LINE_40, [(0.0, 0.0, 0.01 * tick) for tick in range(60)])
    assert 0.1 * 0.01 < line.slope[2] < 1.2 * 0.01
    assert line.value[2] > 0.59


@pytest.mark.parametrize("index", range(len(LAGS)))
def test_a_filter_reads_the_newest_sample_less_earlier_ones(index: int) -> None:
    a, b, c, d, e, f = (0.5 * (each == index) for each in range(len(LAGS)))
    values = [(0.0, 0.1 * tick, 0.001 * tick * tick) for tick in range(60)]
    line = line_of(TrendFilter((a, b, c, d, e, f), (a, b, c, d, e, f)), values)
    half = scale(subtract(values[-1], values[-1 - LAGS[index]]), 0.5)
    assert line.slope == pytest.approx(half)
    assert subtract(line.value, values[-1]) == pytest.approx(half)


@filters
@given(values=st.lists(st.tuples(*[st.floats(-40.0, 40.0)] * 3), min_size=2, max_size=60), bound=st.floats(0.0, 5.0))
@examples(60)
def test_a_line_begins_within_the_deadband(trend: TrendFilter, values: list[Vector], bound: float) -> None:
    """Or at the sample, if rounding takes the whole deadband."""
    rounding = (4e-4, -4e-4, 3e-4)
    line = line_of(trend, values, bound, rounding)
    assert distance(line.value, add(values[-1], rounding)) <= NEAREST * bound * (1.0 + 1e-9)
    assert distance(line.value, values[-1]) <= max(bound, norm(rounding)) * (1.0 + 1e-9)


@filters
def test_extreme_samples_give_a_finite_line(trend: TrendFilter) -> None:
    line = line_of(trend, [(1e150, -1e150, 5e-324), (-1e150, 1e150, 0.0)], 1e149)
    assert all(abs(each) < 1e152 for each in (*line.value, *line.slope))
