"""The report and the status line, on figures made by hand."""

from io import StringIO
from typing import Any

import pytest
from rich.console import Console

from tests.system.scoring.test_session import NONE, RATE, records
from tests.system.test_verdict import clean, figures
from weberlink.protocol.aio.hand_over import PathFacts
from weberlink.protocol.states import State
from weberlink.system.paths import paths_of
from weberlink.system.report import WIDTH, session_report, status_line
from weberlink.system.scoring.session import SessionScore

FINDING = PathFacts(route="", note="asking the mailbox")
RELAYED = PathFacts(0, "relayed", "relay.example", "wlan0", "198.51.100.7:3478", 1)
LIVE = {"addresses": {"listen": "0.0.0.0:47000", "slave": "10.0.0.2:47000"}}


def shown(summary: dict[str, Any]) -> list[str]:
    text = StringIO()
    session_report(summary, "weberlink master", Console(file=text, width=WIDTH))
    return text.getvalue().splitlines()


def line(side: str, state: State, **facts: Any) -> str:
    made = records(2000)
    made["state"] = state.value
    summary = figures(made, NONE) if side == "master" else figures(NONE, made)
    newest = {"master": None, "slave": None} | {side: made[-1]}
    return status_line(newest, summary | LIVE | {"peers": {side: None}} | facts)


def read(facts: dict[str, Any]) -> dict[str, Any]:
    """With the paths as the launcher reads them from a daemon."""
    return facts | {
        "paths": {
            side: paths_of({"paths": [path._asdict() for path in paths]})
            for side, paths in facts.get("paths", {}).items()
        }
    }


def without(state: State, **facts: Any) -> str:
    """The report of a master that met nobody."""
    made = records(5000)
    made["state"] = state.value
    return "\n".join(shown(figures(made, NONE) | {"outcome": "terminated", "drops": {"master": {}}} | read(facts)))


def test_report_begins_with_the_verdict_and_has_no_more_than_there_is_to_say() -> None:
    assert shown(clean())[0] == "good"
    assert shown(clean() | {"outcome": "failed: device fault: unplugged"})[0].endswith("unplugged")
    assert len(shown(figures(NONE, NONE) | {"outcome": "interrupted"})) == 2
    alone = without(State.CONNECTING, paths={"master": [FINDING]})
    assert "5.0 s" in alone and FINDING.note in alone
    assert "channel" not in alone and "felt error" not in alone


def test_report_holds_energy_and_errors_as_far_as_they_are_known() -> None:
    summary = clean()
    summary["energy"] = {"generated_j": 0.0481, "dissipated_j": 0.0123, "bound_j": 0.1145, "bound_share": 0.42}
    summary["force"] |= {"error_rms": 0.7, "aligned_rms": 0.21, "aligned_lag_s": 0.052}
    text = "\n".join(shown(summary))
    for figure in ("48.1 mJ", "114 mJ", "42 %", "12.3 mJ", "0.700 N", "0.210 N", "52 ms"):
        assert figure in text
    summary["energy"] |= {"bound_j": None, "bound_share": None}
    summary["force"]["aligned_rms"] = None
    text = "\n".join(shown(summary))
    assert "48.1 mJ" in text and "0.700 N" in text
    assert not any(figure in text for figure in ("114 mJ", "42 %", "0.210 N"))


@pytest.mark.parametrize(
    ("side", "state", "facts", "expected"),
    [
        ("master", State.CONNECTING, {}, "calling 10.0.0.2:47000"),
        ("slave", State.LISTENING, {}, "listening on 0.0.0.0:47000"),
        ("master", State.CONNECTING, {"paths": {"master": [FINDING]}}, "asking the mailbox"),
        ("slave", State.LISTENING, {"paths": {"slave": [FINDING]}}, "asking the mailbox"),
        ("master", State.CONNECTING, {"addresses": {}}, "connecting"),
        ("master", State.ENGAGED, {}, "engaged with 10.0.0.2:47000"),
        ("master", State.ENGAGED, {"addresses": {}}, "engaged with the peer"),
        ("master", State.ENGAGED, {"paths": {"master": [FINDING]}}, "engaged with 10.0.0.2:47000"),
        ("slave", State.ENGAGED, {"peers": {"slave": {"name": "ann@desk"}}}, "engaged with ann@desk"),
        ("slave", State.SILENT, {"peers": {"slave": {"name": "ann@desk"}}}, "ann@desk silent"),
        ("slave", State.ENGAGED, {"record_age_s": {"slave": 3.2}}, "no record of the slave for 3 s"),
        ("slave", State.ENGAGED, {"recording": {"outcome": "No space left on device"}}, "NOT RECORDING"),
    ],
)
def test_status_line_names_peer_address_and_age(side: str, state: State, facts: dict[str, Any], expected: str) -> None:
    shown = line(side, state, **read(facts))
    assert expected in shown
    assert len(shown) < WIDTH


def test_status_line_shows_figures_in_session_only() -> None:
    assert "force" in line("master", State.ENGAGED)
    assert "force" not in line("master", State.CONNECTING)


def reported(**paths: list[PathFacts]) -> str:
    """The report of a session with 12 ms to the slave and 30 ms back, one datagram in ten lost on the way back."""
    made = records(2000)
    made["rtt_us"], made["one_way_us"], made["jitter_us"] = 42e3, 30e3, 3e3
    made["datagrams_received"], made["datagrams_lost"] = 90, 10
    made["outgoing_loss"], made["peer_burst"] = 0.0123, 1.5
    score = SessionScore(RATE, ("zoh",))
    score.add(made, NONE)
    facts = {"outcome": "completed", "drops": {}, "dscp": 46, "ways": score.ways()} | read({"paths": paths})
    return "\n".join(shown(score.summary() | facts))


def test_report_tells_each_way_and_the_paths_of_each_side() -> None:
    text = reported()
    for figure in ("42.00 ms", "3.00 ms", "12.0", "1.23 %", "29.9", "10.00 %", "1.5"):
        assert figure in text
    assert "path" not in text
    assert "relay.example" in reported(master=[RELAYED, PathFacts(1, "punched", interface="usb0")])
    both = reported(master=[PathFacts()], slave=[PathFacts(remote="10.0.0.9:5000")])
    assert both.count("path: direct\n") == 1, "both sides say the same"
