"""Which records a page is shown, and that they are JSON."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.apps.monitor.feeds import RATE, pieces, records
from weberlink.apps.monitor.samples import COLUMNS, ROTATION, ROWS_PER_S, Thinning, message
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.reader import DTYPE


def thinned(made: np.ndarray, cuts: list[int]) -> list[int]:
    thinning = Thinning(RATE)
    return [tick for piece in pieces(made, cuts) for tick in thinning.choose(piece)["tick"].tolist()]


@given(st.lists(st.integers(0, 2000), max_size=12))
def test_every_fourth_tick_and_all_that_matter_however_they_come_in_pieces(cuts: list[int]) -> None:
    made = records(2000)
    made["sent"][[7, 501, 502, 503]] = 1
    made["fault"][801:1203] = Fault.SILENCE
    made["state"][1301:] = 5
    assert thinned(made, cuts) == sorted({*range(0, 2000, 4), 7, 501, 502, 503, 801, 1203, 1301})


def test_no_more_rows_a_second_than_are_promised() -> None:
    for rate in (10.0, 250.0, 251.0, 1000.0, 4000.0):
        shown = Thinning(rate).choose(records(int(10 * rate)))
        assert len(shown) <= 10 * min(rate, ROWS_PER_S) + 1
    assert len(Thinning(200.0).choose(records(100))) == 100


def test_a_message_has_a_value_for_every_row_and_none_for_what_is_not_known() -> None:
    rows = records(3)
    rows["position"] = [[0.1, 0.2, 0.3]] * 3
    rows["tank"] = [0.5, np.nan, np.inf]
    told = json.loads(json.dumps(message("master", rows, 9.5), allow_nan=False))
    assert told["t"] == [0.5, 0.501, 0.502]
    assert told["columns"]["position"] == [[0.1] * 3, [0.2] * 3, [0.3] * 3]
    assert told["columns"]["rtt_us"] == [None] * 3
    assert told["columns"]["tank"] == [0.5, None, None]
    assert told["columns"]["state"] == [4, 4, 4]


def test_a_packet_of_the_rotation_alone_is_a_row_and_its_columns_are_told_where_there_is_one() -> None:
    made = records(100)
    made["rotation_sent"][[3, 41]] = 1
    rows = Thinning(RATE).choose(made)
    assert rows["tick"].tolist() == sorted({*range(0, 100, 4), 3, 41})
    assert set(message("master", rows, 0.0)["columns"]) == set(COLUMNS)
    told = message("master", rows, 0.0, rotation=True)["columns"]
    assert set(told) == set(COLUMNS) | set(ROTATION)
    assert sum(told["rotation_sent"]) == 2 and len(told["rotation_raw"]) == 3


@pytest.mark.parametrize("columns", [COLUMNS, ROTATION])
def test_every_column_is_one_of_a_record(columns: dict[str, int | None]) -> None:
    assert set(columns) < set(DTYPE.names or ())
    integers = {name for name, digits in columns.items() if digits is None}
    assert integers == {name for name in columns if DTYPE[name].kind == "u"}
