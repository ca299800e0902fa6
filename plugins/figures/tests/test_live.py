"""The report, the document and the log of sessions that run live."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.program import PATIENT, Program, Records, document, faults_of, weberlink
from tests.session.systems import CONFIGS
from tests.session.test_broken_parts import FAULTS, GROUPS, KEYED, MISTAKES, folder, sets  # noqa: F401 - a fixture

DELAY_MS = 20
SETTINGS = (f"link.emulate={{delay_ms: {DELAY_MS}, seed: 1}}", "link.silence_ms=2000", "codec.force.lookahead_ms=10")
NUMBERS = (
    *("duration_s", "ticks.master.count", "ticks.slave.missed", "ticks.master.lateness_us.p99_9", "force.reduction"),
    *("force.packets_per_s", "force.bytes_per_s", "position.error_rms", "position.violation_fraction"),
    *("link.rtt_us.p50", "link.one_way_us.p99", "link.sent", "link.dropped", "energy.generated_j"),
)
"""Figures of a live run that other tools rely on, one of each sort; beside them, `faults` and `outcome`."""


def lines_of(log: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]


@pytest.mark.realtime
def test_report_document_log_and_records_of_a_session_agree(tmp_path: Path) -> None:
    path, log = tmp_path / "report.json", tmp_path / "log"
    with Program("loopback", "--json", path, "--log", log, "--duration", 2, *sets(*SETTINGS)) as program:
        ends = {side: program.engaged(side) for side in ("master", "slave")}
        status, _, _ = program.finish(2.0)
        master, slave = (each.records for each in ends.values())
    report, lines = document(path.read_text(encoding="utf-8")), lines_of(log)
    assert status == 0 and "outcome" in report
    check_that_every_documented_figure_is_there(report)
    check_that_figures_agree(report, master, slave)
    for event in ("started", "summary"):
        assert {line["side"] for line in lines if line["event"] == event} == {"master", "slave"}
    assert (lines[-1]["event"], lines[-1]["outcome"]) == ("ended", report["outcome"])
    assert lines[-1]["force"]["packets_per_s"] == report["force"]["packets_per_s"]


def check_that_every_documented_figure_is_there(report: dict[str, Any]) -> None:
    for path in NUMBERS:
        value: Any = report
        for key in path.split("."):
            value = value[key]
        assert isinstance(value, int | float), path
    assert faults_of(report) == {"master": {}, "slave": {}}


def check_that_figures_agree(report: dict[str, Any], master: Records, slave: Records) -> None:
    ticks, force = report["ticks"], report["force"]
    assert ticks["master"]["count"] == len(master)
    assert ticks["master"]["count"] + ticks["master"]["missed"] == master["tick"][-1] - master["tick"][0] + 1
    assert force["packets"] > 0
    assert force["packets_per_s"] == pytest.approx(force["packets"] / report["duration_s"])
    assert force["coding"]["violation_fraction"] <= ticks["slave"]["missed"] / ticks["slave"]["count"]
    assert report["link"]["received"] + report["link"]["dropped"] <= report["link"]["sent"]
    assert report["link"]["rtt_us"]["p50"] >= 2e3 * DELAY_MS
    assert "bad_tag" not in report["drops"]["master"] | report["drops"]["slave"]
    assert 1e3 * DELAY_MS <= report["ways"]["to_slave"]["one_way_us"]["p50"] < 1e6
    assert report["ways"]["to_master"]["loss"] == 0.0
    assert report["lookahead_ms"] == {"position": 0.0, "force": 10.0}
    assert slave["updates_received"][-1] > 0


def test_the_log_has_the_trace_of_what_prevents_a_session(folder: Path) -> None:  # noqa: F811
    file, override = GROUPS["devices"]
    log = folder / "session.log"
    assert weberlink("loopback", CONFIGS / file, *sets(override.format("needy_devices")), "--log", log).status == 2
    entries = [line["entry"] for line in lines_of(log)]
    assert any("needy.py" in entry for entry in entries)
    assert entries[-1] == MISTAKES["needy"][1]


@pytest.mark.realtime
def test_the_log_has_the_trace_of_what_ends_a_session(folder: Path) -> None:  # noqa: F811
    at, name, _ = FAULTS["robot"]
    log = folder / "session.log"
    overrides = sets(f"{at}={{driver: {name}, where: command}}", KEYED)
    with Program("loopback", *PATIENT, *overrides, "--log", log) as program:
        assert program.finish()[0] == 1
    traced = [line["entry"] for line in lines_of(log) if line["event"] == "trace" and line["side"] == "slave"]
    assert traced[0] == "Traceback (most recent call last):"
    assert any('return things["there"]' in entry for entry in traced)
    assert traced[-1] == "KeyError: 'there'"
