"""Received records: each once, checked, gaps counted; a slave's records on its master's clock."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.apps.monitor.feeds import RATE, description, pieces, records
from tests.examples import examples
from weberlink.apps.monitor.remote.feeds import RECENT_S, WAITING_S, RemoteSide
from weberlink.apps.monitor.remote.joining import HELD_S, MasterClock
from weberlink.apps.monitor.remote.messages import RecordBlock, SideIntroduction
from weberlink.protocol.sealed_stream import StreamError
from weberlink.system.scoring.session import MARGIN_S, Records
from weberlink.telemetry.fault import Fault

TICK_0 = 10.0
APART = 4321.0
"""How far the slave's clock is ahead of the master's [s]."""
INTRODUCTION = SideIntroduction("7", "slave", 1000.0, 10.0, description("slave"))


def block(made: Records, lost: int = 0) -> RecordBlock:
    return RecordBlock("slave", 0 if not len(made) else int(made["tick"][-1]) + 1, lost, made)


def test_repeated_records_count_once() -> None:
    source = RemoteSide(INTRODUCTION)
    tap = source.feed()
    made = records(1000)
    source.push(block(made[:400]))
    source.push(block(made[250:600]))
    source.push(block(made[100:200]))
    source.push(block(made[600:]))
    assert tap.read()["tick"].tolist() == list(range(1000))
    assert (tap.lost, tap.written) == (0, 1000)


def test_gaps_are_lost_but_missed_ticks_are_not() -> None:
    source = RemoteSide(INTRODUCTION)
    made = records(1000)
    made["ticks_missed"][500:] = 20
    made["tick"][500:] += 20
    made["at"][500:] += 0.02
    source.push(block(made[100:300], lost=100))
    assert source.lost == 100
    source.push(block(made[300:600]))
    assert source.lost == 100
    source.push(block(made[650:], lost=50))  # the sharing end counts anew on each connection
    assert source.lost == 150


def test_new_feed_begins_with_recent_records() -> None:
    source = RemoteSide(INTRODUCTION)
    for part in np.split(records(12_000), 60):
        source.push(block(part))
    late = source.feed().read()
    assert 11_999 - RECENT_S * 1000 - 250 < late["tick"][0] <= 12_000 - RECENT_S * 1000
    assert late["tick"][-1] == 11_999


def test_unread_feed_is_bounded_and_counts_losses() -> None:
    source = RemoteSide(INTRODUCTION)
    tap = source.feed()
    for part in np.split(records(30_000), 150):
        source.push(block(part))
    read = tap.read()
    assert len(read) <= WAITING_S * 1000
    assert len(read) + tap.lost == 30_000


def test_feed_is_drained_after_its_last_record() -> None:
    source = RemoteSide(INTRODUCTION)
    first = source.feed()
    source.push(block(records(10)))
    second = source.feed()
    source.push(block(records(10, first=10)))
    assert not first.drained and len(first.read()) == 10
    assert first.drained
    assert not second.drained and len(second.read()) == 20
    source.ended = True
    assert not second.drained, "whoever follows it would miss the end"
    assert len(second.read()) == 0 and second.drained


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("at", np.nan),
        ("at", 1e300),
        ("at", 0.0),
        ("position", np.inf),
        ("selected", 4),
        ("fault", max(Fault) + 1),
        ("state", 0),
        ("state", 7),
    ],
)
def test_impossible_records_are_refused(column: str, value: Any) -> None:
    made = records(10)
    made[column][5] = value
    with pytest.raises(StreamError, match="no daemon writes"):
        RemoteSide(INTRODUCTION).push(block(made))


def slave_records(ticks: int, *, unheard: int = 0, early: float = 0.0) -> Records:
    """A slave that begins `early` before the master's tick 0, and hears it after `unheard` ticks."""
    made = records(ticks)
    masters_time = TICK_0 - early + made["tick"] / RATE
    made["at"] = masters_time + APART
    made["peer_at"] = masters_time - TICK_0
    made["peer_at"][:unheard] = np.nan
    made["updates_sent"] = made["tick"]
    return made


def moved(clock: MasterClock, made: list[Records]) -> Records:
    return np.concatenate([clock.move(piece) for piece in made])


@examples(40)
@given(st.lists(st.integers(0, 2000), max_size=8), st.integers(0, 500))
def test_every_record_is_dated_once_in_order(cuts: list[int], unheard: int) -> None:
    made = slave_records(2000, unheard=unheard, early=0.3)
    clock = MasterClock(RATE, TICK_0)
    clock.learn(records(50, first=7))
    dated = moved(clock, pieces(made, cuts))
    assert dated["tick"].tolist() == list(range(2000))
    assert dated["at"] == pytest.approx(made["at"] - APART, abs=1e-9)
    assert dated["updates_sent"].tolist() == list(range(2000))


def test_records_wait_until_both_clocks_are_known() -> None:
    made = slave_records(300, unheard=100)
    clock = MasterClock(RATE, TICK_0)
    assert not len(clock.move(made[:100]))
    assert not len(clock.move(made[100:200]))
    clock.learn(records(0))
    clock.learn(records(3))
    assert len(clock.move(made[200:])) == 300


def test_waiting_records_are_bounded() -> None:
    clock = MasterClock(RATE, TICK_0)
    clock.learn(records(1))
    made = slave_records(30_000, unheard=29_990, early=29.0)
    dated = moved(clock, np.split(made, 30))
    assert len(dated) <= HELD_S * RATE
    assert dated["at"][0] == pytest.approx(TICK_0 - MARGIN_S, abs=2e-3)
    assert dated["updates_sent"][0] == 1  # of this session only


def test_records_of_an_earlier_master_are_dropped() -> None:
    made = slave_records(1000)
    made["peer_at"][:400] += 500.0
    clock = MasterClock(RATE, TICK_0)
    clock.learn(records(1))
    dated = clock.move(made)
    assert dated["tick"].tolist() == list(range(400, 1000))
    assert dated["at"] == pytest.approx(made["at"][400:] - APART)
    assert dated["updates_sent"][0] == 1


def test_next_master_ends_the_session() -> None:
    made = slave_records(1000)
    made["peer_at"][700:] = made["peer_at"][:300]
    clock = MasterClock(RATE, TICK_0)
    clock.learn(records(1))
    dated = moved(clock, np.split(made, 10))
    assert dated["tick"].tolist() == list(range(700))
    assert clock.lost


def test_time_is_monotonic_when_the_estimate_is_not() -> None:
    made = slave_records(1000)
    made["peer_at"][500:] -= 0.005
    clock = MasterClock(RATE, TICK_0)
    clock.learn(records(1))
    dated = moved(clock, np.split(made, 10))
    assert (np.diff(dated["at"]) >= 0.0).all() and len(dated) == 1000
