"""Perceptual error metrics, beside the same computed tick by tick."""

from itertools import groupby
from math import inf, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.protocol.states import State
from weberlink.system.scoring.perception import FeltError, Threshold, longest_run, noticed
from weberlink.telemetry.reader import DTYPE

magnitudes = st.just(0.0) | st.floats(1e-9, 10.0)


def test_the_threshold_is_a_share_with_a_floor() -> None:
    forces = np.array([[0.0, 0.0, 0.0], [0.0, 3.0, 4.0], [0.1, 0.0, 0.0], [-2.0, 0.0, 0.0]])
    assert Threshold(0.10, 0.02).of(forces).tolist() == pytest.approx([0.02, 0.5, 0.02, 0.2])


@pytest.mark.parametrize(("jnd", "floor"), [(0.0, 0.02), (-0.1, 0.02), (0.1, -0.02), (inf, 0.0), (0.1, inf)])
def test_a_threshold_out_of_range_is_refused(jnd: float, floor: float) -> None:
    with pytest.raises(ValueError, match="jnd must be > 0 and floor_n >= 0"):
        Threshold(jnd, floor)


def test_figures_worked_out_by_hand() -> None:
    errors = np.array([0.0, 0.2, 0.3, 0.1, 0.4, 0.4])
    thresholds = np.array([0.1, 0.1, 0.1, 0.1, 0.2, 0.4])
    found = noticed(errors, thresholds, 1e-3)
    assert found.error_rms_jnd == pytest.approx(sqrt((0 + 4 + 9 + 1 + 4 + 1) / 6))
    assert found.error_max_jnd == pytest.approx(3.0)
    # 0.1 against 0.1 is on the threshold, not beyond it.
    assert found.noticeable_fraction == pytest.approx(3 / 6)
    assert found.noticeable_longest_s == pytest.approx(2e-3)


def test_a_threshold_of_zero_counts_no_jnd() -> None:
    found = noticed(np.array([0.0, 0.5, 0.2]), np.array([0.0, 0.0, 0.1]), 1e-3)
    assert found.error_rms_jnd == found.error_max_jnd == pytest.approx(2.0)
    assert found.noticeable_fraction == pytest.approx(2 / 3)
    assert noticed(np.zeros(3), np.zeros(3), 1e-3) == (0.0, 0.0, 0.0, 0.0)


@given(st.lists(st.booleans(), max_size=30))
def test_the_longest_run_is_that_of_counting(flags: list[bool]) -> None:
    runs = [len(list(group)) for is_set, group in groupby(flags) if is_set]
    assert longest_run(np.array(flags, dtype=bool)) == max(runs, default=0)


@given(st.lists(st.tuples(magnitudes, st.floats(0.01, 1.0)), min_size=1, max_size=20))
def test_noticed_ticks_are_those_above_one_jnd(pairs: list[tuple[float, float]]) -> None:
    errors, thresholds = (np.array(column) for column in zip(*pairs, strict=True))
    found = noticed(errors, thresholds, 1e-3)
    assert found.noticeable_fraction == sum(error > threshold for error, threshold in pairs) / len(pairs)
    assert (found.noticeable_longest_s > 0.0) == (found.noticeable_fraction > 0.0)
    assert found.error_rms_jnd <= found.error_max_jnd * (1.0 + 1e-12)


def ticks(count, **values):
    records = np.zeros(count, DTYPE)
    records["state"] = State.ENGAGED.value
    for name, value in values.items():
        records[name] = value
    return records


def test_the_felt_error_is_in_jnds():
    felt = FeltError(Threshold(0.10, 0.02))
    master = ticks(2, output=[[0.0, 0.0, 2.2], [0.0, 0.0, 0.01]])
    felt.add(master, ticks(2, raw=[[0.0, 0.0, 2.0], [0.0, 0.0, 0.0]]))
    assert felt.rms_jnd == pytest.approx(((1.0**2 + 0.5**2) / 2) ** 0.5)


def test_the_felt_error_ignores_ramps_and_silence():
    felt = FeltError(Threshold(0.10, 0.02))
    wrong = {"output": [[0.0, 0.0, 9.0]]}
    felt.add(ticks(1, **wrong, ramping=1), ticks(1))
    felt.add(ticks(1, **wrong), ticks(1, ramping=1))
    felt.add(ticks(1, **wrong), ticks(1, state=State.SILENT.value))
    assert felt.rms_jnd is None
    felt.add(ticks(1, **wrong), ticks(1))
    assert felt.rms_jnd == pytest.approx(450.0)
