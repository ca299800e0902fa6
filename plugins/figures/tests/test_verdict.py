"""The verdict of a session: every cause from its figures, and none from clean ones."""

from dataclasses import replace
from functools import cache
from typing import Any

import pytest
from hypothesis import given, strategies as st

from plugins.figures.tests.test_session import figures, records
from tests.examples import examples
from weberlink_figures.tree import DEGRADED, FAILURE, GOOD, Figures, Verdict, to_json
from weberlink_figures.verdict import verdict

TICKS = 10_000


@cache
def clean() -> Figures:
    """Figures of a session in which nothing happened, with all that the launcher adds."""
    made = records(TICKS, bound=0.1, datagrams_received=1000)
    return replace(
        figures(made, made),
        faults={"master": {}, "slave": {}},
        drops={"master": {}, "slave": {}},
        peers={"master": {"name": "robot:47000", "refusal": "", "farewell": ""}, "slave": None},
        addresses={"listen": "0.0.0.0:47000", "slave": "10.0.0.2:47000"},
        host={"stalls": 0, "longest_ms": 0.0, "missed": {"master": 0, "slave": 0}, "steal": 0.0, "unknown": None},
        recording={"path": "a.mcap", "bytes": 2_000_000, "outcome": "complete", "lost": {"master": 0}},
        outcome="completed",
    )


def put(part: Any, path: str, value: Any) -> Any:
    """A part of the figures with another value at a place."""
    name, _, rest = path.partition(".")
    if isinstance(part, Figures) and name in part.channels:
        name, rest = "channels", path
    inner = part[name] if isinstance(part, dict) else getattr(part, name)
    changed = put(inner, rest, value) if rest else value
    return part | {name: changed} if isinstance(part, dict) else replace(part, **{name: changed})


CASES: dict[str, tuple[str, dict[str, Any], str]] = {
    "lost": (FAILURE, {"connection.master.ended": "unconnected", "connection.master.last_s": 6.9}, "6.9 s"),
    "unconnected": (
        DEGRADED,
        {"connection.slave.unconnected_s": 6.9, "connection.slave.interruptions": 2},
        "6.9 s in 2",
    ),
    "away": (
        DEGRADED,
        {"connection.master.ended": "away", "connection.master.away_s": 3.0, "peers.master.farewell": "unplugged"},
        "unplugged",
    ),
    "no_call": (
        DEGRADED,
        {"connection.master": None, "connection.slave.ended": "waiting", "connection.slave.waited_s": 60.0},
        "60.0 s",
    ),
    "recording": (FAILURE, {"recording.outcome": "No space left on device"}, "No space left on device; 2000 kB"),
    "missed_ticks": (
        DEGRADED,
        {"ticks.master.missed": 1505, "host.missed.master": 301, "host.steal": 0.031},
        "7.0 % of ticks missed, of which the host took 20 %, steal 3.1 %",
    ),
    "no_figures": (DEGRADED, {"ticks.master.count": 0, "connection.master": None}, "master"),
    "stalled": (DEGRADED, {"faults.master": {"stalled": 2}, "ticks.master.missed_longest_s": 0.5}, "2 times"),
    "unfounded": (FAILURE, {"faults.master": {"unfounded": 2}}, "2 times"),
    "tripped": (DEGRADED, {"faults.slave": {"tripped": 1}}, "slave.limits.trip_n"),
    "update": (DEGRADED, {"faults.slave": {"update": 4}}, "4 updates"),
    "force_limited": (DEGRADED, {"limited.force_ticks": 1200}, "12.0 %"),
    "felt": (DEGRADED, {"force.errors.violation_fraction": 0.12, "force.felt.violation_floor": 0.03}, "12.0 %"),
    "delay": (DEGRADED, {"force.errors.violation_fraction": 0.4, "force.felt.violation_floor": 0.38}, "40.0 %"),
    "bound": (DEGRADED, {"energy.bound_share": 1.25}, "125 %"),
    "loss": (DEGRADED, {"link.lost": 500}, "20.0 %"),
}
"""Name of a cause to its level, the figures that tell it, and a figure of its text; all but three are degraded."""


def with_changes(changes: dict[str, Any]) -> Figures:
    found = clean()
    for path, value in changes.items():
        found = put(found, path, value)
    return found


@pytest.mark.parametrize("name", CASES)
def test_each_cause_follows_from_its_figures(name: str) -> None:
    level, changes, figure = CASES[name]
    found = verdict(with_changes(changes))
    (cause,) = found.causes
    found_level, found_name, text = cause.level, cause.name, cause.text
    assert (found_level, found_name, figure in text) == (level, name, True)
    assert found.line == f"{level} because {text}"
    assert to_json(found) == {"word": level, "causes": [{"level": level, "name": name, "text": text}]}


@pytest.mark.parametrize(
    "changes",
    [
        {"connection.slave.ended": "away", "connection.slave.away_s": 3600.0},
        {"connection.slave.waited_s": 3600.0},
        {"ticks.master.missed": 150},
        {"limited.force_ticks": 50},
        {"force.errors.violation_fraction": 0.05, "force.felt.violation_floor": 0.01},
        {"link.lost": 19},
    ],
    ids=lambda changes: " ".join(map(str, next(iter(changes.items())))),
)
def test_what_is_usual_degrades_nothing(changes: dict[str, Any]) -> None:
    """The master has left a slave; a slave that waited; a few ticks and datagrams."""
    found = verdict(with_changes(changes))
    assert (found, found.line) == (Verdict(GOOD, ()), "good")


@examples(40)
@given(st.sets(st.sampled_from(sorted(CASES.keys() - {"no_call", "no_figures"})), min_size=1))
def test_failures_come_first_and_decide_the_word(chosen: set[str]) -> None:
    found = verdict(with_changes({path: value for name in sorted(chosen) for path, value in CASES[name][1].items()}))
    levels = [cause.level for cause in found.causes]
    assert levels == sorted(levels, key=(FAILURE, DEGRADED).index)
    assert found.word == levels[0]
    assert len({cause.name for cause in found.causes}) == len(found.causes)
