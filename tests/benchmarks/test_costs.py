"""Percentiles, and the cost of the codec."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.codec_speed import measure as measure_codec
from benchmarks.percentiles import NAMES, PERCENTILES, percentile, ratio, ratios, summary

DURATIONS = st.lists(st.floats(0.0, 1e6), min_size=1, max_size=50)


@given(values=DURATIONS, p=st.sampled_from([*PERCENTILES.values(), 0.1, 33.0, 100.0]))
def test_percentiles_are_nearest_rank(values: list[float], p: float) -> None:
    ordered = sorted(values)
    enough = [value for value in ordered if sum(each <= value for each in ordered) * 100.0 >= p * len(ordered) - 1e-6]
    assert percentile(np.array(ordered), p) == enough[0]


def test_rounding_moves_no_rank() -> None:
    assert percentile(np.arange(1.0, 751.0), 4.4) == 33.0
    assert percentile(np.arange(1.0, 1001.0), 99.9) == 999.0


def test_a_summary_needs_no_order() -> None:
    values = np.random.default_rng(1).permutation(np.arange(1.0, 10_001.0))
    assert summary(values) == {"p50": 5000.0, "p90": 9000.0, "p99": 9900.0, "p99_9": 9990.0, "max": 10_000.0}


def test_a_ratio_is_to_the_limit() -> None:
    assert ratio(3.0, 2.0) == pytest.approx(1.5)
    assert ratio(3.0, 0.0) is None
    assert ratio(3.0, None) is None
    assert ratios(summary([4.0]), summary([2.0])) == dict.fromkeys(NAMES, 2.0)


def test_the_codec_codes_the_whole_recording() -> None:
    document = measure_codec(quick=True).as_json()
    assert document["live_samples_per_s"] > 0.0
    assert document["samples"] > 1000
