"""Measures of quality, beside the same computed tick by tick."""

from dataclasses import asdict
from itertools import groupby
from math import inf, log, sqrt
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.records import ticks
from weberlink.figures.felt import JumpsOfRecords, QualityStatistics, Threshold
from weberlink.protocol.states import State
from weberlink.telemetry.record import RELEASED

magnitudes = st.just(0.0) | st.floats(1e-9, 30.0)
thresholds = st.builds(Threshold, st.floats(0.02, 0.5), st.floats(1e-3, 1.0))


@pytest.mark.parametrize(
    ("jnd", "floor"), [(0.0, 0.02), (-0.1, 0.02), (0.1, 0.0), (0.1, -0.02), (inf, 0.1), (0.1, inf)]
)
def test_a_threshold_out_of_range_is_refused(jnd: float, floor: float) -> None:
    with pytest.raises(ValueError, match="jnd and floor_n must be > 0"):
        Threshold(jnd, floor)


def log_error(threshold: Threshold, displayed: float, measured: float) -> float:
    return float(threshold.log_error(np.array([displayed]), np.array([measured]))[0])


@given(thresholds, magnitudes, magnitudes, magnitudes)
def test_log_errors_add_up_and_do_not_depend_on_the_order(
    threshold: Threshold, one: float, other: float, third: float
) -> None:
    """It counts JNDs one upon the other, so those from a to b and from b to c are those from a to c."""
    low, middle, high = sorted((one, other, third))
    steps = log_error(threshold, low, middle) + log_error(threshold, middle, high)
    assert log_error(threshold, low, high) == pytest.approx(steps, abs=1e-9)
    assert log_error(threshold, one, other) == pytest.approx(log_error(threshold, other, one))
    assert log_error(Threshold(0.10, 0.04), 0.04, 0.0) == pytest.approx(1.0), "the absolute threshold"


def summary(threshold: Threshold, ticks: list[tuple[float, float]], pieces: int = 1) -> dict[str, Any]:
    """Of displayed and measured forces along one axis."""
    statistics = QualityStatistics(1e-3, threshold)
    for part in np.array_split(np.array(ticks, dtype=np.float64).reshape(-1, 2), pieces):
        statistics.add(np.abs(part[:, 0] - part[:, 1]), np.abs(part[:, 0]), np.abs(part[:, 1]))
    return asdict(statistics.figures())


def test_measures_worked_out_by_hand() -> None:
    threshold = Threshold(0.10, 0.10)
    found = summary(threshold, [(1.0, 1.0), (1.2, 1.0), (0.7, 1.0), (0.1, 0.0), (2.4, 2.0), (3.6, 4.0)])
    assert found["error_rms_jnd"] == pytest.approx(sqrt((0 + 4 + 9 + 1 + 4 + 1) / 6))
    assert found["error_max_jnd"] == pytest.approx(3.0)
    # 0.1 against 0.1 is on the threshold, not beyond it.
    assert found["noticeable_fraction"] == pytest.approx(3 / 6)
    assert found["noticeable_longest_s"] == pytest.approx(2e-3)
    logs = [log(2.2 / 2.0), log(2.0 / 1.7), log(1.1), log(3.4 / 3.0), log(5.0 / 4.6)]
    assert found["log_error_rms_jnd"] == pytest.approx(sqrt(sum(x * x for x in logs) / 6) / log(1.1))
    assert found["log_error_max_jnd"] == pytest.approx(log(2.0 / 1.7) / log(1.1))


@given(thresholds, st.lists(st.tuples(magnitudes, magnitudes), min_size=1, max_size=30), st.integers(1, 7))
def test_measures_do_not_depend_on_the_pieces(
    threshold: Threshold, ticks: list[tuple[float, float]], pieces: int
) -> None:
    whole = summary(threshold, ticks)
    assert summary(threshold, ticks, pieces) == pytest.approx(whole)
    runs = [
        len(list(group))
        for is_set, group in groupby(abs(d - f) > max(threshold.jnd * f, threshold.floor_n) for d, f in ticks)
        if is_set
    ]
    assert whole["noticeable_longest_s"] == pytest.approx(1e-3 * max(runs, default=0))
    assert whole["noticeable_fraction"] == pytest.approx(sum(runs) / len(ticks))
    assert whole["error_rms_jnd"] <= whole["error_max_jnd"] * (1.0 + 1e-12)


def test_jumps_are_in_jnds_of_the_force_before() -> None:
    statistics = QualityStatistics(1e-3, Threshold(0.10, 0.04))
    statistics.add_jumps(np.array([0.04, 1.0, 3.0]), np.array([0.0, 5.0, 10.0]))
    found = asdict(statistics.figures())
    assert found["jump_max_jnd"] == pytest.approx(3.0)
    assert found["jump_median_jnd"] == pytest.approx(2.0, rel=0.006)


@pytest.mark.parametrize("pieces", [1, 4])
def test_jumps_are_changes_in_ticks_with_an_update(pieces: int) -> None:
    master = ticks(12, tick=np.arange(12), state=State.ENGAGED.value, received=[0, 1, 0, 2, 0, 1, 1, 0, 1, 1, 1, 0])
    master["output"][:, 2] = [0.0, 1.0, 1.5, 3.5, 3.5, 3.0, 3.0, 9.0, 1.0, 2.0, 4.0, 9.0]
    master["ramping"][5] = 1
    master["ramping"][6] = RELEASED
    master["tick"][8:] += 1  # a tick was lost before
    master["state"][10] = State.SILENT.value
    jumps = JumpsOfRecords()
    found = [jumps.of(part) for part in np.array_split(master, pieces)]
    assert np.concatenate([jump for jump, _ in found]).tolist() == [1.0, 2.0, 1.0]
    assert np.concatenate([before for _, before in found]).tolist() == [0.0, 1.5, 1.0]
