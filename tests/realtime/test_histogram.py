"""The histogram against sorted lists and numpy."""

from math import floor, isnan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.realtime.histogram import Histogram

LIMIT = 500
durations = st.lists(st.floats(min_value=0.0, max_value=LIMIT - 1.0), min_size=1, max_size=60)


def filled(values, limit=LIMIT):
    histogram = Histogram(limit)
    for value in values:
        histogram.add(value)
    return histogram


def to_bin(value):
    return float(floor(value + 0.5))


# Quarters of a percent that are exact in binary, so that numpy's product of rank and count rounds nowhere.
@given(durations, st.integers(0, 64))
def test_percentiles_are_those_of_numpy_to_the_bin(values, sixty_fourths):
    p = 100.0 * sixty_fourths / 64.0
    nearest_rank = np.percentile([to_bin(value) for value in values], p, method="inverted_cdf")
    assert filled(values).percentile(p) == nearest_rank


@given(durations, st.integers(1, 1000))
def test_percentiles_are_nearest_rank_for_every_tenth_of_a_percent(values, permille):
    rank = -(-permille * len(values) // 1000)
    assert filled(values).percentile(permille / 10) == to_bin(sorted(values)[rank - 1])


def test_the_last_bit_of_a_percentage_does_not_move_the_rank():
    assert 4.4 * 750 / 100 > 33.0
    assert filled(range(750), limit=1000).percentile(4.4) == 32.0


@given(durations)
def test_count_and_max_are_exact(values):
    histogram = filled(values)
    assert histogram.count == len(values)
    assert histogram.max == max(values)


@given(durations, durations)
def test_merging_is_adding_all(one, other):
    merged, together = filled(one), filled(one + other)
    merged.merge(filled(other))
    assert merged.summary() == together.summary()
    assert merged.count == together.count


def test_a_duration_beyond_the_limit_is_counted_and_kept_as_the_max():
    histogram = filled([1.0, 1e6, 2e6])
    assert histogram.count == 3
    assert histogram.max == 2e6
    assert histogram.percentile(50) == 2e6
    assert histogram.percentile(30) == 1.0


def test_the_limit_itself_still_has_a_bin():
    assert filled([LIMIT, LIMIT + 100.0]).percentile(50) == LIMIT


def test_what_is_no_duration_is_counted_at_the_edges():
    histogram = filled([-3.0, float("nan"), float("inf")])
    assert histogram.count == 3
    assert histogram.percentile(33) == 0.0
    assert histogram.percentile(100) == float("inf")


def test_an_empty_histogram_has_no_figures():
    assert Histogram().count == 0
    assert all(isnan(value) for value in Histogram().summary().values())


def test_the_summary_names_what_reports_name():
    assert filled(range(1, 101)).summary() == {"p50": 50.0, "p99": 99.0, "p99_9": 100.0, "max": 100.0}


@pytest.mark.parametrize("p", [-0.1, 100.1, float("nan")])
def test_percentiles_outside_0_to_100_are_refused(p):
    with pytest.raises(ValueError, match=r"p must be in \[0, 100\]"):
        Histogram().percentile(p)


def test_different_limits_do_not_merge():
    with pytest.raises(ValueError, match="10 us into one up to 500 us"):
        Histogram(500).merge(Histogram(10))


def test_a_limit_needs_a_bin():
    with pytest.raises(ValueError, match="limit_us"):
        Histogram(0)
