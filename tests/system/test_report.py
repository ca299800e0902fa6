"""The report and the status line, on figures made by hand."""

from io import StringIO
from typing import Any

import pytest
from rich.console import Console

from tests.system.scoring.test_session import NONE, records
from tests.system.test_verdict import clean, figures
from weberlink.protocol.states import State
from weberlink.system.report import WIDTH, session_report, status_line

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


@pytest.mark.parametrize(
    ("side", "state", "facts", "expected"),
    [
        ("master", State.CONNECTING, {}, "calling 10.0.0.2:47000"),
        ("slave", State.LISTENING, {}, "listening on 0.0.0.0:47000"),
        ("master", State.ENGAGED, {}, "engaged with 10.0.0.2:47000"),
        ("slave", State.ENGAGED, {"peers": {"slave": {"name": "ann@desk"}}}, "engaged with ann@desk"),
        ("slave", State.SILENT, {"peers": {"slave": {"name": "ann@desk"}}}, "ann@desk silent"),
        ("slave", State.ENGAGED, {"record_age_s": {"slave": 3.2}}, "no record of the slave for 3 s"),
        ("slave", State.ENGAGED, {"recording": {"outcome": "No space left on device"}}, "NOT RECORDING"),
    ],
)
def test_status_line_names_peer_address_and_age(side: str, state: State, facts: dict[str, Any], expected: str) -> None:
    shown = line(side, state, **facts)
    assert expected in shown
    assert len(shown) < WIDTH


def test_status_line_shows_figures_in_session_only() -> None:
    assert "force" in line("master", State.ENGAGED)
    assert "force" not in line("master", State.CONNECTING)
