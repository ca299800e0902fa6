"""Readings at any moment: between neighbours, exact at samples, never ahead of the newest, late by the stated lag."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.arms.interpolation import Interpolation, TimedValues

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
def test_sample_is_exact_at_its_time_plus_lag(walk: list[tuple[float, float, float]], lag: float, keep: int) -> None:
    interpolation = Interpolation(lag, keep)
    for sample in filled(interpolation, walk)[-keep:]:
        given_back = interpolation.at(sample.at + lag)
        assert given_back.values == pytest.approx(sample.values, rel=1e-6, abs=1e-6)
        assert given_back.at == pytest.approx(sample.at, abs=1e-9)


@given(st.lists(st.tuples(st.floats(1e-4, 0.1), st.floats(0.0, 0.1)), min_size=1, max_size=8))
def test_time_is_monotonic_and_late_by_the_lag(steps: list[tuple[float, float]]) -> None:
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


def test_a_sample_that_is_not_newer_changes_nothing() -> None:
    interpolation = Interpolation(0.0)
    for at, value in ((1.0, 1.0), (2.0, 2.0), (1.5, 9.0), (2.0, 9.0)):
        interpolation.add(TimedValues(at, (value,)))
    assert interpolation.at(1.5).values == (1.5,)
    assert interpolation.at(3.0).values == (2.0,)


def test_nothing_is_made_up_before_the_first_sample() -> None:
    with pytest.raises(LookupError):
        Interpolation(0.0).at(1.0)
