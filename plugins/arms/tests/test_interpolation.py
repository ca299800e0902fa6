"""Readings at any moment: between neighbours, exact at samples, never ahead of the newest, late by the stated lag."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink_arms.interpolation import Interpolation, TimedValues

steps = st.lists(st.tuples(st.floats(1e-4, 0.1), st.floats(0.0, 0.1)), min_size=1, max_size=8)


@given(steps, st.floats(0.0, 0.05), st.integers(2, 8))
def test_values_are_exact_monotonic_and_late_by_the_lag(
    steps: list[tuple[float, float]], lag: float, keep: int
) -> None:
    """A sample holds the square of its time and the time itself, which is linear between any two."""
    interpolation, at, now, last, samples = Interpolation(lag, keep), 100.0, 100.0, -1.0, list[TimedValues]()
    for step, wait in steps:
        at += step
        samples = [*samples, TimedValues(at, (at * at, at))][-keep:]
        interpolation.add(samples[-1])
        now = max(now, at) + wait
        reading = interpolation.at(now)
        assert reading.at == pytest.approx(min(max(now - lag, samples[0].at), at), abs=1e-9)
        assert reading.values[1] == pytest.approx(reading.at, abs=1e-9)
        assert reading.at >= last
        last = reading.at
    for sample in samples:
        assert interpolation.at(sample.at + lag).values == pytest.approx(sample.values, abs=1e-6)


def test_a_sample_that_is_not_newer_changes_nothing() -> None:
    interpolation = Interpolation(0.0)
    for at, value in ((1.0, 1.0), (2.0, 2.0), (1.5, 9.0), (2.0, 9.0)):
        interpolation.add(TimedValues(at, (value,)))
    assert interpolation.at(1.5).values == (1.5,)
    assert interpolation.at(3.0).values == (2.0,)


def test_nothing_is_made_up_before_the_first_sample() -> None:
    with pytest.raises(LookupError):
        Interpolation(0.0).at(1.0)
