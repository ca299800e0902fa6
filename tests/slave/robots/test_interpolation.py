"""Readings at any moment: between neighbours, exact at samples, never ahead of the newest, late by the stated lag."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.slave.robots.interpolation import Interpolation, TimedValues

numbers = st.floats(-1e3, 1e3)
steps = st.lists(st.tuples(st.floats(1e-4, 0.1), numbers, numbers), min_size=1, max_size=6)


def filled(interpolation: Interpolation, walk: list[tuple[float, float, float]]) -> list[TimedValues]:
    at, samples = 100.0, []
    for step, a, b in walk:
        at += step
        samples.append(TimedValues(at, (a, b)))
        interpolation.add(samples[-1])
    return samples


@given(steps, st.floats(0.0, 0.05), st.integers(2, 6))
def test_a_sample_is_given_exactly_at_its_time_and_lag(
    walk: list[tuple[float, float, float]], lag: float, keep: int
) -> None:
    interpolation = Interpolation(lag, keep)
    for sample in filled(interpolation, walk)[-keep:]:
        given_back = interpolation.at(sample.at + lag)
        assert given_back.values == pytest.approx(sample.values, rel=1e-6, abs=1e-6)
        assert given_back.at == pytest.approx(sample.at, abs=1e-9)


@given(steps, st.floats(0.0, 1.0), st.data())
def test_in_between_it_is_on_the_line(
    walk: list[tuple[float, float, float]], share: float, data: st.DataObject
) -> None:
    interpolation = Interpolation(0.01, 6)
    samples = filled(interpolation, walk)
    if len(samples) < 2:
        return
    a, b = data.draw(st.sampled_from(list(pairwise(samples))))
    now = a.at + share * (b.at - a.at) + 0.01
    between = interpolation.at(now)
    exact = (now - 0.01 - a.at) / (b.at - a.at)
    for low, high, value in zip(a.values, b.values, between.values, strict=True):
        assert value == pytest.approx(low + exact * (high - low), rel=1e-6, abs=1e-6)
        assert min(low, high) - 1e-9 <= value <= max(low, high) + 1e-9


@given(st.lists(st.tuples(st.floats(1e-4, 0.1), st.floats(0.0, 0.1)), min_size=1, max_size=8))
def test_while_samples_come_time_never_goes_back_and_is_late_by_the_lag(steps: list[tuple[float, float]]) -> None:
    lag = 0.02
    interpolation = Interpolation(lag, keep=8)
    first = at = now = 100.0
    last = -1.0
    for step, wait in steps:
        at += step
        first = at if first == 100.0 else first
        interpolation.add(TimedValues(at, (at,)))
        now = max(now, at) + wait
        reading = interpolation.at(now)
        assert reading.at >= last
        assert reading.at == pytest.approx(min(max(now - lag, first), at), abs=1e-9)
        assert reading.values[0] == pytest.approx(reading.at, abs=1e-9)
        last = reading.at


def test_after_the_newest_it_holds_and_does_not_extrapolate() -> None:
    interpolation = Interpolation(0.005)
    interpolation.add(TimedValues(1.0, (0.0,)))
    interpolation.add(TimedValues(1.1, (1.0,)))
    assert interpolation.at(9.0) == TimedValues(1.1, (1.0,))


def test_before_the_oldest_that_is_kept_it_holds() -> None:
    interpolation = Interpolation(0.0, keep=2)
    for number in range(4):
        interpolation.add(TimedValues(float(number), (float(number),)))
    assert interpolation.at(0.5) == TimedValues(2.0, (2.0,))


def test_a_sample_that_is_not_newer_is_ignored() -> None:
    interpolation = Interpolation(0.0)
    interpolation.add(TimedValues(1.0, (1.0,)))
    interpolation.add(TimedValues(1.0, (5.0,)))
    interpolation.add(TimedValues(0.5, (7.0,)))
    assert interpolation.at(2.0) == TimedValues(1.0, (1.0,))


def test_a_restart_forgets_what_was() -> None:
    interpolation = Interpolation(0.0)
    interpolation.add(TimedValues(1.0, (1.0,)))
    interpolation.restart(TimedValues(0.5, (3.0,)))
    assert interpolation.at(0.7) == TimedValues(0.5, (3.0,))


def test_nothing_is_made_up_before_the_first_sample() -> None:
    with pytest.raises(LookupError):
        Interpolation(0.0).at(1.0)


@pytest.mark.parametrize(("lag", "keep"), [(-0.001, 4), (float("nan"), 4), (0.01, 1)])
def test_a_lag_or_a_number_of_samples_that_makes_no_sense_is_refused(lag: float, keep: int) -> None:
    with pytest.raises(ValueError, match="lag"):
        Interpolation(lag, keep)
