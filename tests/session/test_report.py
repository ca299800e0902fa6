"""What reports a session: the kernel's summary, and how that of another distribution is chosen."""

import json
import sys
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from tests.program import document, weberlink
from tests.records import ticks
from tests.session.packages import install
from tests.session.systems import CONFIGS, configuration
from weberlink.config import ConfigurationError
from weberlink.protocol.states import State
from weberlink.registry import Registry
from weberlink.session import report
from weberlink.session.report import CHOSEN_BY, REPORTS, SUMMARY, Facts, chosen_report
from weberlink.session.simulation import simulate
from weberlink.session.summary import Summary
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.reader import DTYPE, Records

NONE = np.empty(0, DTYPE)
FACTS = Facts(outcome="completed", faults={"master": {}, "slave": {}})


def records(count: int, **columns: Any) -> Records:
    return ticks(count, **{"start": 10.0, "state": State.ENGAGED.value, "rtt_us": np.nan} | columns)


def test_the_summary_of_a_run_is_that_of_its_records() -> None:
    settings, pieces = configuration(file="rotation.yaml"), list[tuple[Records, Records]]()
    summary = Summary(settings)
    facts = simulate(settings, 1.0, [summary.add, lambda *records: pieces.append(records)])
    status, found, show = summary.end(facts)
    master, slave = (np.concatenate(each) for each in zip(*pieces, strict=True))
    assert (status, found["outcome"], found["verdict"]) == (0, "completed", {"word": "ended", "causes": []})
    assert found["duration_s"] == pytest.approx(len(master) / 1000.0)
    assert {name: found[name]["packets"] for name in ("force", "torque", "position", "orientation")} == {
        "force": slave["updates_sent"][-1],
        "torque": slave["second_updates_sent"][-1],
        "position": master["updates_sent"][-1],
        "orientation": master["second_updates_sent"][-1],
    }
    engaged = (slave["state"] == State.ENGAGED.value).sum()
    assert found["force"]["reduction"] == 1.0 - found["force"]["packets"] / engaged
    assert found["link"]["sent"] == master["datagrams_sent"][-1] + slave["datagrams_sent"][-1]
    assert json.dumps(found, allow_nan=False)
    console = Console(width=80, file=StringIO())
    show("a title", console)
    text = console.file.getvalue()
    assert "ended: completed\na title  1" in text and f"force: {found['force']['packets']} updates" in text


def test_one_side_alone_tells_the_updates_of_both() -> None:
    summary = Summary(configuration(), ["slave"])
    summary.add(NONE, records(1000, updates_sent=7, updates_received=9, rtt_us=1500.0, ticks_missed=3))
    found = summary.end(FACTS).document
    assert (found["force"]["packets"], found["position"]["packets"]) == (7, 9)
    assert found["ticks"] == {"master": {"count": 0, "missed": 0}, "slave": {"count": 1000, "missed": 3}}
    assert found["link"]["rtt_us"]["p50"] == 1500.0
    assert summary.round_trip_s is None, "after a second of the session"
    summary.add(NONE, records(1500, start=11.0, rtt_us=2500.0))
    assert summary.round_trip_s == pytest.approx(2e-3)


def test_a_running_session_tells_what_a_person_can_remove_and_a_line_of_its_state() -> None:
    summary = Summary(configuration(), ["master"])
    faults = np.where(np.arange(500) < 100, 0, Fault.UNPROVEN.value)
    summary.add(records(500, state=State.CONNECTING.value, fault=faults), NONE)
    facts = Facts(recording={"running": False, "outcome": "No space left"})
    assert list(summary.urgent(facts)) == ["key"]
    assert summary.status_line(facts) == "   0.5 s  NOT RECORDING  master connecting"
    failed = summary.end(Facts(outcome="completed", faults={"master": {"unproven": 1}}))
    assert failed.status == 1
    assert [cause["name"] for cause in failed.document["verdict"]["causes"]] == ["key"]


@pytest.mark.parametrize(
    ("facts", "status"),
    [({}, 0), ({"interrupted": True}, 130), ({"status": 2}, 2), ({"outcome": "failed: it burns"}, 1)],
)
def test_exit_status(facts: Any, status: int) -> None:
    assert Summary(configuration()).end(FACTS | facts).status == status


def test_the_summary_is_chosen_in_the_environment_and_has_no_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(CHOSEN_BY, SUMMARY)
    ended = weberlink("simulate", CONFIGS / "loopback.yaml", "--duration", 0.1, "--json", "-")
    assert (ended.status, document(ended.output)["verdict"]["word"]) == (0, "ended")
    assert "--log" in weberlink("loopback", "--log", tmp_path / "log").complaint()
    monkeypatch.setenv(CHOSEN_BY, "sumary")
    assert "nearest is 'summary'" in weberlink("loopback").complaint()


@pytest.mark.parametrize(
    ("source", "why"),
    [("raise RuntimeError('no\\nink')", "RuntimeError: no ink"), ("class Report: ...", "has no open_log")],
)
def test_a_report_that_cannot_be_used_is_one_line(
    source: str, why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(
        tmp_path, "broken-report", {"broken_report": source}, "[weberlink.reports]\nbroken = broken_report:Report\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "broken_report", raising=False)
    monkeypatch.setenv(CHOSEN_BY, "broken")
    said = weberlink("simulate", CONFIGS / "loopback.yaml").complaint()
    assert "report broken of broken-report" in said or "report broken: " in said
    assert why in said


def test_of_two_others_none_reports_without_a_choice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = "from weberlink.session.summary import Summary as One, Summary as Other"
    install(tmp_path, "two-reports", {"two": source}, "[strange.reports]\none = two:One\nother = two:Other\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delenv(CHOSEN_BY, raising=False)
    monkeypatch.setattr(report, "REPORTS", Registry("report", REPORTS.built_in, "strange.reports"))
    with pytest.raises(
        ConfigurationError, match=rf"one of two-reports, other of two-reports\); name one in {CHOSEN_BY}"
    ):
        chosen_report()
    monkeypatch.setenv(CHOSEN_BY, "other")
    assert chosen_report() == "other"
