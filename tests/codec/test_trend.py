"""A line that begins beside the sample: what of it survives the wire, and where the sender's filters put it."""

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.codec import Channel, Decoder, Update, force_channel, position_channel
from weberlink.codec.predictors.contract import EncodeContext, History
from weberlink.codec.predictors.model import Line
from weberlink.codec.predictors.trend import FINEST, HOLD_20, LAGS, LINE_40, NEAREST, SLOWEST, TREND, TrendFilter
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector, distance, norm, subtract

steps = st.floats(-400.0, 400.0)
rates = st.floats(-20.0, 20.0)


def channels(axes: str) -> list[Channel]:
    return [force_channel(predictor="trend", axes=axes), position_channel(predictor="trend", axes=axes)]


@pytest.mark.parametrize("axes", ["z", "xz", "xyz"])
@given(offset=st.tuples(steps, steps, steps), slope=st.tuples(rates, rates, rates))
@examples(50)
def test_a_line_survives_the_wire_towards_the_sample(axes: str, offset: Vector, slope: Vector) -> None:
    """To half a percent of the largest component, in steps of a sixteenth of the wire's."""
    for channel in channels(axes):
        step, components = channel.value_quantizer.step, channel.value_quantizer.components
        levels = tuple(range(7, 7 + channel.grid.size))
        newest, decoder = channel.grid.sample(40, levels), Decoder(channel)
        begin = channel.value_quantizer.vector(
            [a + b * step for a, b in zip(components(newest.value), components(offset), strict=True)]
        )
        line = Line(begin, channel.value_quantizer.vector([each * step for each in components(slope)]), 40)
        decoder.apply(Update(40, 0, levels, TREND.packed(line, newest, channel.grid)))
        said = decoder.state[1]
        assert isinstance(said, Line)
        assert said.tick == 40
        near, meant = subtract(said.value, newest.value), subtract(begin, newest.value)
        largest, fastest = max(map(abs, meant)), max(map(abs, line.slope))
        for one, other in zip(near, meant, strict=True):
            assert abs(one) <= abs(other) + 1e-12
            assert abs(one - other) <= max(FINEST * step, 2.0**-6 * largest) * (1.0 + 1e-6)
        for one, other in zip(said.slope, line.slope, strict=True):
            assert abs(one - other) <= max(SLOWEST * step, 2.0**-6 * fastest) * (1.0 + 1e-6)


def test_at_the_tick_of_the_sample_the_line_begins_beside_it() -> None:
    channel = force_channel(predictor="trend", axes="z")
    decoder = Decoder(channel)
    newest = channel.grid.sample(3, (1000, 0))
    line = Line((0.0, 0.0, 1.0625), (0.0, 0.0, -(2.0**-8)), 3)
    decoder.apply(Update(3, 0, (1000, 0), TREND.packed(line, newest, channel.grid)))
    assert decoder.value(3) == pytest.approx((0.0, 0.0, 1.0625), abs=1e-3)
    assert decoder.value(19) == pytest.approx((0.0, 0.0, 1.0), abs=1e-3)


def history_of(values: Sequence[Vector]) -> History:
    history = History()
    for tick, value in enumerate(values):
        history.add(tick, value, ZERO)
    return history


def occasion(values: Sequence[Vector], bound: float, rounding: Vector = ZERO) -> EncodeContext:
    newest = (values[-1][0] + rounding[0], values[-1][1] + rounding[1], values[-1][2] + rounding[2])
    return EncodeContext(Sample(len(values) - 1, newest, ZERO), None, bound, history_of(values))


@pytest.mark.parametrize("trend", [HOLD_20, LINE_40])
def test_a_constant_is_held_and_one_sample_says_nothing(trend: TrendFilter) -> None:
    assert trend.model(occasion([(1.0, 2.0, 3.0)], 0.3)) is None
    line = trend.model(occasion([(1.0, 2.0, 3.0)] * 50, 0.3))
    assert line == Line((1.0, 2.0, 3.0), ZERO, 49)


@pytest.mark.parametrize("trend", [HOLD_20, LINE_40])
def test_it_is_linear_in_the_signal_until_the_deadband_confines_it(trend: TrendFilter) -> None:
    values = [(0.01 * tick, -0.02 * tick, 0.001 * tick * tick) for tick in range(40)]
    line = trend.model(occasion(values, 1e9))
    double = trend.model(occasion([(2.0 * x, 2.0 * y, 2.0 * z) for x, y, z in values], 1e9))
    assert line is not None
    assert double is not None
    assert double.value == pytest.approx(tuple(2.0 * each for each in line.value))
    assert double.slope == pytest.approx(tuple(2.0 * each for each in line.slope))


def test_a_ramp_goes_on() -> None:
    """Regressions of recorded hands lean towards rest: less than all of a slope goes on, and more than none."""
    line = LINE_40.model(occasion([(0.0, 0.0, 0.01 * tick) for tick in range(60)], 1e9))
    assert line is not None
    assert 0.1 * 0.01 < line.slope[2] < 1.2 * 0.01
    assert line.value[2] > 0.59


@pytest.mark.parametrize("index", range(len(LAGS)))
def test_a_filter_reads_the_newest_sample_less_those_before(index: int) -> None:
    weights = [0.0] * len(LAGS)
    weights[index] = 0.5
    one = (weights[0], weights[1], weights[2], weights[3], weights[4], weights[5])
    values = [(0.0, 0.1 * tick, 0.001 * tick * tick) for tick in range(60)]
    line = TrendFilter(one, one).model(occasion(values, 1e9))
    before = values[-1 - LAGS[index]]
    half = tuple(0.5 * (a - b) for a, b in zip(values[-1], before, strict=True))
    assert line is not None
    assert line.slope == pytest.approx(half)
    assert subtract(line.value, values[-1]) == pytest.approx(half)


@given(values=st.lists(st.tuples(*[st.floats(-40.0, 40.0)] * 3), min_size=2, max_size=60), bound=st.floats(0.0, 5.0))
@examples(60)
def test_a_line_begins_within_the_deadband_of_what_was_measured(values: list[Vector], bound: float) -> None:
    """Or at the sample, where the wire's rounding takes all of the deadband."""
    rounding = (4e-4, -4e-4, 3e-4)
    for trend in (HOLD_20, LINE_40):
        line = trend.model(occasion(values, bound, rounding))
        assert line is not None
        newest = tuple(value + off for value, off in zip(values[-1], rounding, strict=True))
        aside = norm(subtract(line.value, (newest[0], newest[1], newest[2])))
        assert aside <= NEAREST * bound * (1.0 + 1e-9)
        assert distance(line.value, values[-1]) <= max(bound, norm(rounding)) * (1.0 + 1e-9)


def test_before_the_earliest_sample_it_stands_for_all() -> None:
    short = [(0.0, 0.0, 1.0 + 0.1 * tick) for tick in range(5)]
    filled = [short[0]] * (LAGS[-1] - 4) + short
    for trend in (HOLD_20, LINE_40):
        one, other = trend.model(occasion(short, 1e9)), trend.model(occasion(filled, 1e9))
        assert one is not None
        assert other is not None
        assert (one.value, one.slope) == (other.value, other.slope)


@pytest.mark.parametrize("trend", [HOLD_20, LINE_40])
def test_extreme_samples_are_filtered_to_what_is_finite(trend: TrendFilter) -> None:
    line = trend.model(occasion([(1e150, -1e150, 5e-324), (-1e150, 1e150, 0.0)], 1e149))
    assert line is not None
    assert all(abs(each) < 1e152 for each in (*line.value, *line.slope))
