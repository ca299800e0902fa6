"""The link: how long a side was in session, the figures of each way, and the facts of paths."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.figures.test_session import NONE, records, score
from tests.records import ticks
from weberlink.figures.link import AWAY, CONNECTED, UNCONNECTED, ConnectionScore
from weberlink.protocol.paths import LONGEST, MOST, LinkPath, finding, notable, paths_of
from weberlink.protocol.session import EXPIRY
from weberlink.protocol.states import State

PERIOD = 0.01
LISTENING, CONNECTING, ENGAGED, SILENT, CLOSED = (
    State.LISTENING, State.CONNECTING, State.ENGAGED, State.SILENT, State.CLOSED,
)  # fmt: skip
Stretch = tuple[State, float]


@pytest.mark.parametrize(
    ("stretches", "ended", "expected"),
    [
        ([(LISTENING, 2), (ENGAGED, 3), (CLOSED, 1)], CONNECTED, {"waited_s": 2, "connected_s": 3}),
        ([(ENGAGED, 2), (LISTENING, 4)], AWAY, {"connected_s": 2, "away_s": 4}),
        (
            [(ENGAGED, 2), (SILENT, EXPIRY), (LISTENING, 4)],
            UNCONNECTED,
            {"connected_s": 2, "unconnected_s": EXPIRY + 4, "last_s": EXPIRY + 4, "interruptions": 1},
        ),
        (
            [(ENGAGED, 1), (SILENT, 0.5), (ENGAGED, 1), (SILENT, 1), (ENGAGED, 1)],
            CONNECTED,
            {"connected_s": 3, "unconnected_s": 1.5, "interruptions": 2},
        ),
        (
            [(ENGAGED, 1), (SILENT, EXPIRY), (CONNECTING, 1), (ENGAGED, 1)],
            CONNECTED,
            {"unconnected_s": EXPIRY + 1, "interruptions": 1},
        ),
        ([(ENGAGED, 1), (SILENT, 0.5), (CONNECTING, 2)], AWAY, {"unconnected_s": 0.5, "away_s": 2}),
    ],
    ids=["orderly", "left", "lost", "interrupted", "returned", "left_while_silent"],
)
def test_states_are_counted_by_what_they_mean(stretches: list[Stretch], ended: str, expected: dict[str, float]) -> None:
    states = [state.value for state, seconds in stretches for _ in range(round(seconds / PERIOD))]
    score = ConnectionScore()
    score.add(ticks(len(states), every=PERIOD, state=states))
    found = vars(score.figures())
    assert found["ended"] == ended
    for key, value in expected.items():
        assert found[key] == pytest.approx(value, abs=2 * PERIOD), key
    seconds = sum(found[key] for key in ("waited_s", "connected_s", "unconnected_s", "away_s"))
    assert seconds == pytest.approx(sum(s for state, s in stretches if state is not CLOSED), abs=2 * PERIOD)


def test_each_way_is_measured_by_its_receiver() -> None:
    master = records(1000, one_way_us=20e3, rtt_us=25e3, datagrams_received=900, datagrams_lost=100, jitter_us=700.0)
    slave = records(1000, one_way_us=5e3, rtt_us=25e3, datagrams_received=999, datagrams_lost=1)
    slave["peer_burst"][500:] = 3.0
    both = score(master, slave, pieces=7)["ways"]
    assert both["jitter_us"]["p50"] == pytest.approx(700.0, rel=0.005)
    to_slave, to_master = both["to_slave"], both["to_master"]
    assert to_slave["one_way_us"]["p50"] == pytest.approx(5e3, rel=0.005)
    assert to_master["one_way_us"]["p99"] == pytest.approx(20e3, rel=0.005)
    assert (to_slave["loss"], to_master["loss"]) == (0.001, 0.1)
    assert (to_slave["burst"], to_master["burst"]) == (3.0, None)
    assert not to_slave["is_reported"] and not to_master["is_reported"]


def test_one_side_alone_tells_both_ways() -> None:
    master = records(1000, rtt_us=25e3, one_way_us=20e3, outgoing_loss=np.linspace(0.0, 0.02, 1000))
    alone = score(master, NONE)["ways"]["to_slave"]
    assert alone["one_way_us"]["p50"] == pytest.approx(5e3, rel=0.005)
    assert alone["loss"] == pytest.approx(0.01)
    assert alone["is_reported"]


def test_without_a_session_nothing_is_known() -> None:
    waiting = records(100, state=State.CONNECTING.value, jitter_us=np.nan)
    for told in (score(waiting, NONE)["ways"], score(NONE, NONE)["ways"]):
        assert told["jitter_us"] == {"p50": None, "p99": None}
        assert {way["loss"] for way in (told["to_slave"], told["to_master"])} == {None}
        assert told["to_master"]["one_way_us"]["p50"] is None


RELAYED = LinkPath(0, "relayed", "relay.example", "wlan0", "198.51.100.7:3478", 1)
DIRECT = LinkPath(remote="10.0.0.2:47000")
UNFOUND = LinkPath(route="", note="asking the mailbox")
anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(LinkPath._fields), inner),
    max_leaves=20,
)


def test_facts_of_the_daemon_come_through_whole() -> None:
    known = [RELAYED, DIRECT, UNFOUND._replace(dscp=46)]
    assert paths_of({"paths": [path._asdict() for path in known]}) == known
    assert paths_of(None) == paths_of({}) == []


@given(anything)
def test_a_strange_description_gives_words_all_the_same(found: Any) -> None:
    paths = paths_of({"paths": found})
    assert len(paths) <= MOST
    for path in paths:
        assert len(path.words()) < 3 * LONGEST
        assert isinstance(path.dscp_words(46), str)
    assert isinstance(finding(paths), str)
    assert all(isinstance(text, str) for text in notable([], paths))


def test_notable_are_other_routes_and_changes() -> None:
    assert list(notable([], [DIRECT, UNFOUND])) == []
    assert list(notable([], [RELAYED])) == ["path: relayed by relay.example over wlan0, 1 change"]
    assert list(notable([RELAYED], [RELAYED._replace(dscp=46)])) == []
    assert list(notable([DIRECT], [DIRECT._replace(changes=1)])) == ["path: direct, 1 change"]
    assert finding([UNFOUND]) == "asking the mailbox" and finding([UNFOUND, DIRECT]) == finding([]) == ""
