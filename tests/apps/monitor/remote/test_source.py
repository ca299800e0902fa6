"""What arrives of a remote side: once each, checked, and counted where something is missing."""

from typing import Any

import numpy as np
import pytest

from tests.apps.monitor.feeds import description, records
from weberlink.apps.monitor.remote.channel import StreamError
from weberlink.apps.monitor.remote.messages import Begin, Piece
from weberlink.apps.monitor.remote.source import RECENT_S, WAITING_S, RemoteSource
from weberlink.system.scoring.session import Records

BEGIN = Begin("7", "slave", 1000.0, 10.0, description("slave"))


def piece(made: Records, lost: int = 0) -> Piece:
    return Piece("slave", 0 if not len(made) else int(made["tick"][-1]) + 1, lost, made)


def test_after_a_lost_connection_what_comes_again_counts_once() -> None:
    source = RemoteSource(BEGIN)
    tap = source.tap()
    made = records(1000)
    source.push(piece(made[:400]))
    source.push(piece(made[250:600]))
    source.push(piece(made[100:200]))
    source.push(piece(made[600:]))
    assert tap.read()["tick"].tolist() == list(range(1000))
    assert (tap.lost, tap.written) == (0, 1000)


def test_what_never_came_is_lost_but_a_deadline_without_a_tick_is_not() -> None:
    source = RemoteSource(BEGIN)
    made = records(1000)
    made["ticks_missed"][500:] = 20
    made["tick"][500:] += 20
    made["at"][500:] += 0.02
    source.push(piece(made[100:300], lost=100))
    assert source.lost == 100
    source.push(piece(made[300:600]))
    assert source.lost == 100
    source.push(piece(made[650:], lost=50))  # the sharing end counts anew on each connection
    assert source.lost == 150


def test_a_feed_that_begins_later_has_the_last_seconds() -> None:
    source = RemoteSource(BEGIN)
    for part in np.split(records(12_000), 60):
        source.push(piece(part))
    late = source.tap().read()
    assert 11_999 - RECENT_S * 1000 - 250 < late["tick"][0] <= 12_000 - RECENT_S * 1000
    assert late["tick"][-1] == 11_999


def test_a_feed_that_nobody_reads_is_bounded_and_says_so() -> None:
    source = RemoteSource(BEGIN)
    tap = source.tap()
    for part in np.split(records(30_000), 150):
        source.push(piece(part))
    read = tap.read()
    assert len(read) <= WAITING_S * 1000
    assert len(read) + tap.lost == 30_000


def test_it_is_drained_when_the_end_was_read() -> None:
    source = RemoteSource(BEGIN)
    one, other = source.tap(), source.tap()
    source.push(piece(records(10)))
    other.cut()
    assert not other.drained and len(other.read()) == 10
    assert other.drained
    source.end()
    assert not one.drained
    one.read()
    assert one.drained
    one.close()
    one.close()


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("at", np.nan),
        ("at", 1e300),
        ("at", 0.0),
        ("position", np.inf),
        ("selected", 4),
        ("control", 200),
        ("fault", 9),
        ("state", 0),
        ("state", 7),
    ],
)
def test_what_no_daemon_writes_is_refused(column: str, value: Any) -> None:
    made = records(10)
    made[column][5] = value
    with pytest.raises(StreamError, match="no daemon writes"):
        RemoteSource(BEGIN).push(piece(made))
