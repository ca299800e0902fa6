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


def test_report_begins_with_the_verdict() -> None:
    assert shown(clean())[:2] == ["good", "weberlink master  10.0 s  completed"]
    failed = shown(clean() | {"outcome": "failed: device fault: unplugged"})
    assert failed[:2] == ["failed because device fault: unplugged", "weberlink master  10.0 s"]


def test_report_without_a_session_has_no_empty_table() -> None:
    made = records(5000)
    made["state"] = State.CONNECTING.value
    facts: dict[str, Any] = {"outcome": "terminated", "drops": {"master": {}}}
    text = "\n".join(shown(figures(made, NONE) | facts))
    assert text.startswith("failed because the slave did not answer in 5.0 s")
    assert "channel" not in text
    assert "felt error" not in text
    assert "master: connected 0.0 s, waited 5.0 s" in text


def test_report_without_a_tick_is_two_lines() -> None:
    assert len(shown(figures(NONE, NONE) | {"outcome": "interrupted"})) == 2


def test_report_tells_the_bound_of_the_energy_and_the_error_without_the_delay() -> None:
    summary = clean()
    summary["energy"] = {"generated_j": 0.0481, "dissipated_j": 0.0123, "bound_j": 0.1145, "bound_share": 0.42}
    summary["force"] |= {"error_rms": 0.7, "aligned_rms": 0.21, "aligned_lag_s": 0.052}
    lines = shown(summary)
    assert "energy at the hand: 48.1 mJ out, 114 mJ allowed (42 % used); 12.3 mJ dissipated" in lines
    assert "felt error 0.700 N RMS; 0.210 N with the delay removed (52 ms)" in lines
    summary["energy"] |= {"bound_j": None, "bound_share": None}
    summary["force"]["aligned_rms"] = None
    lines = shown(summary)
    assert "energy at the hand: 48.1 mJ out; 12.3 mJ dissipated" in lines
    assert not any("delay removed" in line for line in lines)


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


def test_report_tells_each_way_apart() -> None:
    text = reported()
    assert "round trip 42.00 ms (p99 42.00), jitter 3.00 ms (p99 3.00)\n" in text
    assert "to the slave: 12.0" in text and "1.23 % lost, as that side reported" in text
    assert "to the master: 29.9" in text and "10.00 % lost in runs of 1.5" in text
    assert "path" not in text


def test_report_names_paths_of_each_side() -> None:
    words = "relayed by relay.example over wlan0, 1 change"
    second = PathFacts(1, "punched", interface="usb0")
    assert f"\npath: {words}\npath 2: punched over usb0\n" in reported(master=[RELAYED, second])
    two = reported(master=[RELAYED], slave=[PathFacts()])
    assert f"\npath of the master: {words}\npath of the slave: direct\n" in two
    both = reported(master=[PathFacts()], slave=[PathFacts(remote="10.0.0.9:5000")])
    assert both.count("path: direct\n") == 1, "both sides say the same"


def test_report_without_a_path_says_what_was_tried() -> None:
    made = records(5000)
    made["state"] = State.CONNECTING.value
    facts: dict[str, Any] = {"outcome": "terminated", "drops": {"master": {}}}
    text = shown(figures(made, NONE) | facts | read({"paths": {"master": [FINDING]}}))[0]
    assert text == "failed because the slave did not answer in 5.0 s: asking the mailbox"
