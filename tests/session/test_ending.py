"""How long a side was connected, and why a session failed."""

from dataclasses import asdict, replace
from typing import Any

import pytest

from tests.records import ticks
from weberlink.protocol.session import EXPIRY
from weberlink.protocol.states import State
from weberlink.session.ending import AWAY, CONNECTED, UNCONNECTED, WAITING, Connection, failures

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
    times = Connection()
    times.add(ticks(len(states), every=PERIOD, state=states))
    found = asdict(times)
    assert found["ended"] == ended
    for key, value in expected.items():
        assert found[key] == pytest.approx(value, abs=2 * PERIOD), key
    seconds = sum(found[key] for key in ("waited_s", "connected_s", "unconnected_s", "away_s"))
    assert seconds == pytest.approx(sum(s for state, s in stretches if state is not CLOSED), abs=2 * PERIOD)


KEPT = Connection(0.1, 10.0, 0.0, 0, 0.0, CONNECTED, 10.0)
NEVER = Connection(2.5, 0.0, 0.0, 0, 0.0, WAITING, 2.5)
LOST = Connection(0.1, 3.0, 6.9, 1, 0.0, UNCONNECTED, 6.9)
FACTS: dict[str, Any] = {
    "outcome": "completed",
    "faults": {"master": {}, "slave": {}},
    "drops": {"master": {}, "slave": {}},
    "peers": {"master": {"name": "robot:47000", "refusal": ""}, "slave": None},
    "addresses": {"listen": "0.0.0.0:47000", "slave": "10.0.0.2:47000"},
    "recording": {"path": "a.mcap", "bytes": 2_000_000, "outcome": "complete"},
}
CASES: dict[str, tuple[dict[str, Any], str]] = {
    "lost": ({"master": LOST}, "the slave was lost: not heard for the last 6.9 s"),
    "key": ({"slave": NEVER, "drops": {"slave": {"unproven": 3}}}, "a call did not prove the key"),
    "no_answer": ({"master": NEVER}, "the slave did not answer in 2.5 s at 10.0.0.2:47000: is it running there"),
    "refused": ({"slave": NEVER, "peers": {"slave": {"refusal": "weber: 0.2"}}}, "weber: 0.2"),
    "device": ({"outcome": "failed: device fault: unplugged"}, "unplugged"),
    "robot": ({"outcome": "failed: robot fault: no power"}, "no power"),
    "taken_over": ({"outcome": "failed: taken over by bob"}, "bob"),
    "killed": ({"outcome": "failed: slave was killed by SIGKILL"}, "SIGKILL"),
    "ended": ({"outcome": "failed: it burns"}, "it burns"),
    "emergency_stop": ({"outcome": "failed: emergency stop by pedal"}, "emergency stop by pedal"),
    "recording": ({"recording": {"bytes": 2_000_000, "outcome": "No space left"}}, "No space left; 2000 kB"),
    "unfounded": ({"faults": {"master": {"unfounded": 2}}}, "2 times"),
}
"""Name of a cause to what tells it, and a part of its words."""
USUAL: list[dict[str, Any]] = [
    {"outcome": "the page asked for it"},
    {"recording": {"running": True}},
    {"recording": None},
    {"slave": Connection(0.1, 3.0, 0.0, 0, 3600.0, AWAY, 3600.0)},
    {"master": Connection(0.1, 3.0, 0.2, 1, 0.0, UNCONNECTED, 0.2)},
    {"slave": Connection(0.1, 3.0, 1.9, 1, 0.0, UNCONNECTED, 1.9)},
    {"slave": Connection(3600.0, 3.0, 0.0, 0, 0.0, CONNECTED, 3.0)},
    {"slave": NEVER, "master": None},
    {"drops": {"slave": {"unproven": 100}}},
    {"faults": {"slave": {"refused": 2}}},
]
"""The master has left a slave; a lost goodbye; a slave that waited; strangers that call while there is a session."""


def found(**changes: Any) -> dict[str, str]:
    sides = {side: changes.pop(side, KEPT) for side in ("master", "slave")}
    facts: Any = FACTS | changes
    return failures(facts, sides)


@pytest.mark.parametrize("name", CASES)
def test_each_cause_follows_from_what_is_known(name: str) -> None:
    changes, words = CASES[name]
    causes = found(**changes)
    assert list(causes) == [name]
    assert words in causes[name]


@pytest.mark.parametrize("changes", USUAL, ids=str)
def test_what_is_usual_is_no_failure(changes: dict[str, Any]) -> None:
    assert found(**changes) == {}


def test_a_running_master_waits_longer_for_an_answer() -> None:
    assert list(found(master=NEVER)) == ["no_answer"]
    assert found(master=NEVER, outcome=None) == {}
    assert list(found(master=replace(NEVER, waited_s=4.0), outcome=None)) == ["no_answer"]
