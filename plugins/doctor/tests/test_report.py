"""The whole report: checks never raise, the text fits a terminal, the exit status tells of problems."""

import io
import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given, strategies as st
from rich.console import Console

from plugins.doctor.tests.host.machines import FILES, HOST, asking, machine
from tests.examples import examples
from tests.program import document, weberlink
from tests.session.systems import CONFIGS
from weberlink.config import load
from weberlink_doctor.host.checks import CHECKS, Check
from weberlink_doctor.host.examination import advised, examine
from weberlink_doctor.host.machine import Machine
from weberlink_doctor.host.trial import SessionTrial
from weberlink_doctor.report import Finding, Grade, Needs

READ = [row for row in CHECKS if row.area not in ("rights", "host", "devices")]
"""Checks that start no process and ask no library of devices."""
LAN = CONFIGS / "lan.yaml"
OK, ADVICE, PROBLEM, UNKNOWN = Grade.OK, Grade.ADVICE, Grade.PROBLEM, Grade.UNKNOWN


def test_an_ideal_machine_has_nothing_to_fix_and_missing_files_are_unknown(tmp_path: Path) -> None:
    ideal = machine(tmp_path, which=lambda name: name if name == "cyclictest" else None)
    assert [each for each in examine(Needs(), ideal).findings if each.grade is not OK] == []
    found = examine(Needs(), machine(tmp_path / "dark", dict.fromkeys(FILES)), READ).findings
    assert {"clock source", "throttling", "receive buffer"} <= {each.check for each in found if each.grade is UNKNOWN}


@examples(25)
@given(st.dictionaries(st.sampled_from(sorted(FILES)), st.text(max_size=60), max_size=len(FILES)))
def test_arbitrary_files_never_raise(tmp_path_factory: pytest.TempPathFactory, files: dict[str, str]) -> None:
    host = machine(tmp_path_factory.mktemp("machine"), {name: text.replace("\0", "") for name, text in files.items()})
    needs = asking(link={"listen": "0.0.0.0:47000", "slave": "robot:47000"}, realtime={"cpus": (0, 1)})
    for each in examine(needs, host, READ).findings:
        assert (each.fix is None) == (each.grade is OK) or each.grade is UNKNOWN


def test_failing_check_becomes_a_finding_and_the_fix_of_a_row_is_for_those_that_need_one(tmp_path: Path) -> None:
    def judge(_machine: Machine, _needs: Needs) -> Iterator[Finding]:
        yield Finding(OK, "a")
        yield Finding(ADVICE, "b")
        yield Finding(PROBLEM, "c", "own")
        raise ZeroDivisionError("no\nclock")

    report = examine(Needs(), machine(tmp_path), [Check("area", "clock", judge, "x")])
    assert [(each.grade, each.fix) for each in report.findings] == [
        (OK, None), (ADVICE, "x"), (PROBLEM, "own"), (UNKNOWN, None)
    ]  # fmt: skip
    assert {(each.check, each.area) for each in report.findings} == {("clock", "area")}
    assert "no clock" in report.findings[3].found
    stream = io.StringIO()
    report.show(Console(file=stream, width=80))
    assert stream.getvalue().splitlines()[-1].startswith("1 problem, 1 advice, 1 unknown")


def test_command_reports_of_this_machine_and_fails_on_problems(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    # A trial of the host takes seconds; its own tests make a real one.
    monkeypatch.setattr(Machine, "host_trial", lambda _machine, **_request: HOST)
    monkeypatch.setattr(Machine, "session_trial", lambda _machine, **_: SessionTrial(p99_us=40.0))
    out = tmp_path / "doctor.json"
    ended = weberlink("doctor", LAN, "--side", "master", "--json", out)
    told = document(out.read_text(encoding="utf-8"))
    problems = {each["check"]: each["fix"] for each in told["findings"] if each["grade"] == "problem"}
    assert {"slave address", "key file"} <= set(problems)  # the file is an example
    assert (all(problems.values()), ended.status, told["counts"]["problem"]) == (True, 1, len(problems))
    assert (told["needs"]["sides"], told["needs"]["drivers"], told["needs"]["encrypted"]) == (
        ["master"], {"master": "operator"}, True
    )  # fmt: skip
    assert f"\n{len(problems)} problem" in ended.output
    alone = weberlink("doctor", "--json", "-")
    told = json.loads(alone.output)
    assert (told["needs"]["file"], alone.status) == (None, int(told["counts"]["problem"] > 0))


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        (("doctor", LAN, "--set", "rate_hz=x"), "rate_hz"),
        (("doctor", "--link", "robot"), "--link"),
        (("device", "test", "phantom"), "phantom"),
        (("device", "test", "operator", "--set", "foce_n=1"), "master.device.foce_n"),
    ],
)
def test_a_wrong_argument_is_one_line_that_names_it(arguments: tuple[object, ...], field: str) -> None:
    assert field in weberlink(*arguments).complaint()


def test_what_check_warns_of_is_advice_with_its_remedy() -> None:
    ask = ["codec.force.weber=0.5", "link.security=none"]
    (found,) = advised(load(CONFIGS / "loopback.yaml", ask))
    assert (found.grade, found.fix, found.area) == (ADVICE, "use at most that", "file")
    assert found.found.startswith("codec.force.weber 0.5")
    assert [each.grade for each in advised(load(CONFIGS / "loopback.yaml"))] == [OK]
    (found,) = advised(load(LAN, ["link.key_file=none.key"]))
    assert found.grade is UNKNOWN and "none.key" in found.found


def test_needs_follow_the_configuration() -> None:
    overrides = ["rate_hz=500", "realtime.cpus=[0, 1]", "realtime.priority=7", "link.slave=robot:5"]
    system = load(LAN, overrides).system
    needs = Needs(system, ["slave"])
    assert (needs.rate_hz, needs.pinned, needs.realtime.priority) == (500.0, {"slave": 1}, 7)
    assert (needs.listen, needs.slave) == (("0.0.0.0", 47000), None)  # the slave calls nobody
    assert Needs(system, ["master"]).slave == ("robot", 5)
    loopback = Needs(load(CONFIGS / "loopback.yaml").system)
    assert (loopback.listen, loopback.slave) == (None, None)  # any port that is free
