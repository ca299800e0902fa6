"""Rows of a page: which records are shown, felt error, rates of the last second."""

import json
import re
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.watching.sources import BANK, RATE, pieces, records
from weberlink.protocol.states import State
from weberlink.system.scoring.session import SessionScore
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.reader import DTYPE
from weberlink.watching.rows import (
    COLUMNS,
    LONGEST_WAIT,
    ROTATION,
    ROWS_PER_S,
    FeltErrorPairs,
    Pace,
    Thinning,
    felt_message,
    samples_message,
)

PAGE = Path(str(files("weberlink.apps.monitor") / "page"))


def thinned(made: np.ndarray, cuts: list[int]) -> list[int]:
    thinning = Thinning(RATE)
    return [tick for piece in pieces(made, cuts) for tick in thinning.choose(piece)["tick"].tolist()]


@given(st.lists(st.integers(0, 2000), max_size=12))
def test_every_fourth_tick_and_all_events_are_shown(cuts: list[int]) -> None:
    made = records(2000)
    made["sent"][[7, 501, 502, 503]] = 1
    made["fault"][801:1203] = Fault.SILENCE
    made["state"][1301:] = 5
    assert thinned(made, cuts) == sorted({*range(0, 2000, 4), 7, 501, 502, 503, 801, 1203, 1301})


def test_rows_per_second_are_limited() -> None:
    for rate in (10.0, 250.0, 251.0, 1000.0, 4000.0):
        shown = Thinning(rate).choose(records(int(10 * rate)))
        assert len(shown) <= 10 * min(rate, ROWS_PER_S) + 1
    assert len(Thinning(200.0).choose(records(100))) == 100


def test_unknown_values_are_null_in_json() -> None:
    rows = records(3)
    rows["position"] = [[0.1, 0.2, 0.3]] * 3
    rows["energy"] = [0.5, np.nan, np.inf]
    told = json.loads(json.dumps(samples_message("master", rows, 9.5), allow_nan=False))
    assert told["t"] == [0.5, 0.501, 0.502]
    assert told["columns"]["position"] == [[0.1] * 3, [0.2] * 3, [0.3] * 3]
    assert told["columns"]["rtt_us"] == [None] * 3
    assert told["columns"]["energy"] == [0.5, None, None]
    assert told["columns"]["state"] == [4, 4, 4]


def test_rotation_packets_are_rows_with_their_columns() -> None:
    made = records(100)
    made["rotation_sent"][[3, 41]] = 1
    rows = Thinning(RATE).choose(made)
    assert rows["tick"].tolist() == sorted({*range(0, 100, 4), 3, 41})
    assert set(samples_message("master", rows, 0.0)["columns"]) == set(COLUMNS)
    told = samples_message("master", rows, 0.0, rotation=True)["columns"]
    assert set(told) == set(COLUMNS) | set(ROTATION)
    assert sum(told["rotation_sent"]) == 2 and len(told["rotation_raw"]) == 3


@pytest.mark.parametrize("columns", [COLUMNS, ROTATION])
def test_columns_exist_in_the_record(columns: dict[str, int | None]) -> None:
    assert set(columns) < set(DTYPE.names or ())
    integers = {name for name, digits in columns.items() if digits is None}
    assert integers == {name for name in columns if DTYPE[name].kind == "u"}


def test_page_reads_every_column() -> None:
    scripts = "".join(path.read_text(encoding="utf-8") for path in (PAGE / "js").glob("*.js"))
    assert [name for name in COLUMNS if not re.search(rf"\b{name}\b", scripts)] == []


@examples(40)
@given(
    st.lists(st.integers(0, 900), min_size=3, max_size=3),
    st.lists(st.integers(0, 900), min_size=3, max_size=3),
    st.sampled_from((0.0, 2e-4, 4.9e-4, 5.1e-4, 8e-4)),
)
def test_felt_error_equals_the_figures(cuts: list[int], others: list[int], phase: float) -> None:
    master, slave = records(900, phase=phase, seed=1), records(900, seed=2)
    slave["state"][200:300] = State.SILENT.value
    master["ramping"][400:450] = 1
    score, felt = SessionScore(RATE, BANK), FeltErrorPairs(RATE)
    errors: list[float] = []
    for one, other in zip(pieces(master, cuts), pieces(slave, others), strict=True):
        score.add(one, other)
        told = felt_message(*felt.add(one, other), origin=10.0)
        errors += told["error_n"]
        assert told["t"] == sorted(told["t"])
        assert told["deadbands"] == pytest.approx([error / 1.5 for error in told["error_n"]], abs=1e-4)
    force = score.summary()["force"]
    assert max(errors) == pytest.approx(force["error_max"], abs=1e-5)
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(force["error_rms"], abs=1e-5)
    assert np.mean(np.array(errors) > 1.5) == pytest.approx(force["violation_fraction"], abs=2 / len(errors))


def test_zero_bound_has_no_error_in_deadbands() -> None:
    master, slave = records(10), records(10)
    assert felt_message(*FeltErrorPairs(RATE).add(master, slave), origin=10.0)["deadbands"] == [None] * 9


def test_rows_waiting_for_the_other_side_are_bounded() -> None:
    felt = FeltErrorPairs(RATE)
    for first in range(0, 20_000, 1000):
        assert not len(felt.add(records(0), records(1000, first=first))[0])
    _, pairs = felt.add(records(1000, first=17_000), records(0))
    assert (pairs["tick"][0], pairs["tick"][-1]) == (20_000 - LONGEST_WAIT, 17_998)


def test_pace_covers_the_last_second() -> None:
    pace = Pace()
    assert pace.packets_per_s is None and pace.reduction is None
    made = records(5000)
    # 100 a second for 3 s, then 10 a second.
    made["updates_sent"] = np.minimum(np.arange(5000) // 10, 300) + np.maximum(np.arange(5000) - 3000, 0) // 100
    for piece in np.split(made[:3000], 60):
        pace.add(piece)
    assert pace.packets_per_s == pytest.approx(100.0, rel=0.02)
    assert pace.reduction == pytest.approx(0.9, abs=0.005)
    for piece in np.split(made[3000:], 40):
        pace.add(piece)
    assert pace.packets_per_s == pytest.approx(10.0, rel=0.11)
    assert pace.reduction == pytest.approx(0.99, abs=0.002)


def test_reduction_is_unknown_without_a_session() -> None:
    pace, made = Pace(), records(100)
    made["state"] = 2
    pace.add(made)
    pace.add(records(0))
    assert (pace.packets_per_s, pace.reduction) == (0.0, None)
