"""The report and the status line show the figures that they are given."""

from dataclasses import replace
from io import StringIO
from typing import Any

import pytest
from rich.console import Console

from plugins.figures.tests.test_session import NONE, figures, records
from plugins.figures.tests.test_verdict import clean, put
from weberlink.protocol.paths import LinkPath
from weberlink.protocol.states import State
from weberlink_figures.report import WIDTH, session_report, status_line
from weberlink_figures.tree import Energy, Figures

FINDING = [LinkPath(route="", note="asking the mailbox")]
RELAYED = [LinkPath(0, "relayed", "relay.example", "wlan0", "198.51.100.7:3478", 1)]


def shown(figures: Figures) -> str:
    text = StringIO()
    session_report(figures, "weberlink master", Console(file=text, width=WIDTH))
    return text.getvalue()


def test_the_report_begins_with_the_verdict_and_has_what_is_known_of_energy_and_errors() -> None:
    known = clean()
    for place, value in {
        "energy": Energy(0.0481, 0.0123, 0.1145, 0.42),
        "force.errors.error_rms": 0.7,
        "force.felt.aligned_rms": 0.21,
        "force.felt.aligned_lag_s": 0.052,
    }.items():
        known = put(known, place, value)
    text = shown(known)
    assert text.startswith("good\n")
    for figure in ("48.1 mJ", "114 mJ", "42 %", "12.3 mJ", "0.700 N", "0.210 N", "52 ms"):
        assert figure in text
    unknown = put(put(known, "energy", Energy(0.0481, 0.0123, None, None)), "force.felt.aligned_rms", None)
    text = shown(replace(unknown, outcome="failed: device fault: unplugged"))
    assert text.splitlines()[0].endswith("unplugged")
    assert "48.1 mJ" in text and not any(figure in text for figure in ("114 mJ", "42 %", "0.210 N"))


def test_the_report_of_a_master_that_met_nobody_says_why() -> None:
    made = records(5000, state=State.CONNECTING.value)
    found = replace(figures(made, NONE), outcome="terminated", paths={"master": FINDING})
    text = shown(found)
    assert "5.0 s" in text and "asking the mailbox" in text and "channel" not in text


def test_the_report_has_each_way_and_the_paths() -> None:
    way = {"rtt_us": 42e3, "one_way_us": 30e3, "jitter_us": 3e3, "outgoing_loss": 0.0123, "peer_burst": 1.5}
    made = records(2000, datagrams_received=90, datagrams_lost=10, **way)
    known = replace(figures(made, NONE), outcome="completed", dscp=46)
    text = shown(replace(known, paths={"master": [path._replace(dscp=0) for path in RELAYED]}))
    for figure in ("42.00 ms", "3.00 ms", "12.0", "1.23 %", "29.9", "10.00 %", "1.5", "relay.example", "46 came as 0"):
        assert figure in text
    text = shown(replace(known, paths={"master": [path._replace(dscp=46) for path in RELAYED]}))
    assert "DSCP 46" in text and "came as" not in text


@pytest.mark.parametrize(
    ("side", "state", "facts", "expected"),
    [
        ("master", State.CONNECTING, {}, "calling 10.0.0.2:47000"),
        ("slave", State.LISTENING, {}, "listening on 0.0.0.0:47000"),
        ("slave", State.LISTENING, {"paths": {"slave": FINDING}}, "asking the mailbox"),
        ("master", State.ENGAGED, {"addresses": {}}, "engaged with the peer"),
        ("slave", State.ENGAGED, {"peers": {"slave": {"name": "ann@desk"}}}, "engaged with ann@desk"),
        ("slave", State.SILENT, {"peers": {"slave": {"name": "ann@desk"}}}, "ann@desk silent"),
        ("slave", State.ENGAGED, {"record_age_s": {"slave": 3.2}}, "no record of the slave for 3 s"),
        ("slave", State.ENGAGED, {"recording": {"outcome": "No space left on device"}}, "NOT RECORDING"),
    ],
)
def test_the_status_line_has_peer_age_and_recording(
    side: str, state: State, facts: dict[str, Any], expected: str
) -> None:
    made = records(2000, state=state.value)
    live = {"addresses": {"listen": "0.0.0.0:47000", "slave": "10.0.0.2:47000"}, "peers": {side: None}}
    found = figures(made, NONE) if side == "master" else figures(NONE, made)
    line = status_line({"master": None, "slave": None, side: made[-1]}, replace(found, **live | facts))
    assert expected in line and len(line) < WIDTH
    assert ("force" in line) == (state is State.ENGAGED)
