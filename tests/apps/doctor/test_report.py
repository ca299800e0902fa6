"""The whole report: checks never raise, the text fits a terminal, the exit status tells of problems."""

import io
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console
from typer.testing import CliRunner

from tests.apps.doctor.machines import FILES, HOST, machine
from tests.examples import examples
from tests.system.systems import CONFIGS
from weberlink.apps.doctor import CHECKS, Check, DoctorReport, Finding, Grade, Machine, Needs, examine
from weberlink.apps.doctor.machine import Unreadable
from weberlink.cli import app
from weberlink.protocol.keys import generate
from weberlink.system.configuration import load

READ = [row for row in CHECKS if row.area not in ("rights", "host", "devices")]
"""Checks that start no process and ask no library of devices."""


def shown(found: DoctorReport) -> list[str]:
    stream = io.StringIO()
    found.show(Console(file=stream, width=80))
    return stream.getvalue().splitlines()


def test_ideal_machine_has_no_findings_to_fix(tmp_path: Path) -> None:
    found = examine(Needs(), machine(tmp_path, which=lambda name: name if name in ("cyclictest", "sockperf") else None))
    assert [each for each in found.findings if each.grade is not Grade.OK] == []


def test_missing_files_are_unknown_with_a_reason(tmp_path: Path) -> None:
    found = examine(Needs(), machine(tmp_path, dict.fromkeys(FILES)), READ)
    dark = {each.check: each.found for each in found.findings if each.grade is Grade.UNKNOWN}
    assert {"clock source", "throttling", "receive buffer"} <= set(dark)
    assert all("no such file" in words or "cannot be read" in words for words in dark.values())


@examples(25)
@given(st.dictionaries(st.sampled_from(sorted(FILES)), st.text(max_size=60), max_size=len(FILES)))
def test_arbitrary_files_never_raise(tmp_path_factory: pytest.TempPathFactory, files: dict[str, str]) -> None:
    host = machine(tmp_path_factory.mktemp("machine"), {name: text.replace("\0", "") for name, text in files.items()})
    needs = Needs(listen=("0.0.0.0", 47000), slave=("robot", 47000), cpus=(0, 1))
    for each in examine(needs, host, READ).findings:
        assert (each.fix is None) == (each.grade is Grade.OK) or each.grade is Grade.UNKNOWN


def row(*findings: Finding | Exception, fix: str | None = None) -> Check:
    """A row whose judgement is these findings; an exception is raised."""

    def judge(_machine: Machine, _needs: Needs) -> Iterator[Finding]:
        for each in findings:
            if isinstance(each, Exception):
                raise each
            yield each

    return Check("area", "clock", judge, fix)


def test_failing_check_becomes_a_finding(tmp_path: Path) -> None:
    rows = [
        row(Finding(Grade.OK, "seen"), ZeroDivisionError("no\nclock")),
        row(Unreadable("/x cannot be read without root")),
    ]
    assert examine(Needs(), machine(tmp_path), rows).findings == [
        Finding(Grade.OK, "seen", None, "clock", "area"),
        Finding(Grade.UNKNOWN, "clock: ZeroDivisionError: no clock", None, "clock", "area"),
        Finding(Grade.UNKNOWN, "clock: /x cannot be read without root", None, "clock", "area"),
    ]


def test_fix_of_the_row_is_for_findings_that_need_one(tmp_path: Path) -> None:
    found = [Finding(Grade.OK, "a"), Finding(Grade.ADVICE, "b"), Finding(Grade.PROBLEM, "c", "own")]
    report = examine(Needs(), machine(tmp_path), [row(*found, fix="common")])
    assert [each.fix for each in report.findings] == [None, "common", "own"]


def test_fix_is_printed_on_one_unbroken_line(tmp_path: Path) -> None:
    fix = "echo " + "long " * 40 + "| sudo tee /x"
    lines = shown(examine(Needs(), machine(tmp_path), [row(Finding(Grade.PROBLEM, "it is so", fix))]))
    assert lines == ["area", "  problem it is so", f"          -> {fix}", "1 problem, 0 advice, 0 unknown"]


def test_long_finding_is_wrapped_at_words(tmp_path: Path) -> None:
    lines = shown(examine(Needs(), machine(tmp_path), [row(Finding(Grade.OK, "word " * 20))]))
    assert lines[1].startswith("  ok      word ")
    assert lines[2].startswith(" " * 10 + "word")
    assert max(map(len, lines)) <= 80


@pytest.fixture
def soon_seen_host(monkeypatch: pytest.MonkeyPatch) -> None:
    """A trial of the host takes seconds; its own tests make a real one."""
    monkeypatch.setattr(Machine, "host_trial", lambda _machine, **_request: HOST)


@pytest.mark.usefixtures("soon_seen_host")
def test_report_of_this_machine_fits_80_columns(tmp_path: Path) -> None:
    generate(tmp_path / "weberlink.key")
    found = examine(Needs.of(load(CONFIGS / "lan.yaml", [f"link.key_file={tmp_path / 'weberlink.key'}"])), Machine())
    checks = {each.check for each in found.findings}
    assert {"clock source", "scheduling", "memory lock", "punctuality", "host", "port", "key file", "Python"} <= checks
    for line in shown(found):
        assert len(line) <= 80 or line.startswith(" " * 10 + "-> ") or str(tmp_path) in line, line


@pytest.mark.usefixtures("soon_seen_host")
def test_command_writes_json_and_fails_on_problems(tmp_path: Path) -> None:
    out = tmp_path / "doctor.json"
    ended = CliRunner().invoke(app, ["doctor", str(CONFIGS / "lan.yaml"), "--side", "master", "--json", str(out)])
    document: dict[str, Any] = json.loads(out.read_text(encoding="utf-8"))
    problems = [each for each in document["findings"] if each["grade"] == "problem"]
    assert {"slave address", "key file"} <= {each["check"] for each in problems}  # the file is an example
    assert all(each["fix"] for each in problems)
    assert ended.exit_code == 1
    assert document["counts"]["problem"] == len(problems)
    assert document["needs"]["sides"] == ["master"]
    assert document["needs"]["drivers"] == {"master": "operator"}
    assert re.search(rf"^{len(problems)} problem", ended.output, re.M)


@pytest.mark.usefixtures("soon_seen_host")
def test_json_is_alone_on_standard_output() -> None:
    ended = CliRunner().invoke(app, ["doctor", "--json", "-"])
    document = json.loads(ended.stdout)
    assert document["needs"]["file"] is None
    assert ended.exit_code == (1 if document["counts"]["problem"] else 0)


def test_needs_follow_the_configuration(tmp_path: Path) -> None:
    overrides = ["rate_hz=500", "realtime.cpus=[0, 1]", "realtime.priority=7", "link.slave=robot:5"]
    needs = Needs.of(load(CONFIGS / "lan.yaml", overrides), ["slave"])
    assert (needs.rate_hz, needs.pinned, needs.priority) == (500.0, {"slave": 1}, 7)
    assert (needs.listen, needs.slave) == (("0.0.0.0", 47000), None)  # the slave calls nobody
    assert Needs.of(load(CONFIGS / "lan.yaml", overrides), ["master"]).slave == ("robot", 5)
    loopback = Needs.of(load(CONFIGS / "loopback.yaml"))
    assert (loopback.listen, loopback.slave, loopback.key_file) == (None, None, None)  # any port that is free
