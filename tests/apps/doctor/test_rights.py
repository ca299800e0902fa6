"""What a trial says of rights, and the trial itself, in a real child process."""

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

from tests.apps.doctor.machine import GRANTS, REFUSED, TRIAL, graded, look, machine
from tests.apps.doctor.test_processors import DEEP
from weberlink.apps.doctor import Finding, Grade, Needs
from weberlink.apps.doctor import trial as trials
from weberlink.apps.doctor.rights import rights
from weberlink.apps.doctor.trial import Request, Trial, run_trial


def refused(*names: str) -> Trial:
    return replace(TRIAL, grants=GRANTS | dict.fromkeys(names, REFUSED))


def late(p99: float, missed: int = 0) -> Trial:
    return replace(TRIAL, lateness_us={"p50": 10.0, "p99": p99, "max": p99}, missed=missed)


def found(tmp_path: Path, trial: Trial, needs: Needs | None = None, **answers: object) -> dict[str, Finding]:
    host = machine(tmp_path, trial=lambda _request: trial, **answers)
    return {each.check: each for each in look(rights, host, needs)}


def test_all_granted_is_fine(tmp_path: Path) -> None:
    findings = found(tmp_path, TRIAL, limit=lambda _which: -1)
    assert set(graded(list(findings.values())).values()) == {"ok"}
    assert set(findings) == {"scheduling", "memory lock", "idle latency", "timer slack", "punctuality"}


def test_a_refusal_is_a_problem_with_the_line_for_the_limits(tmp_path: Path) -> None:
    findings = found(tmp_path, refused("priority", "memory"))
    for name, limit in (("scheduling", "rtprio 98"), ("memory lock", "memlock unlimited")):
        assert findings[name].grade is Grade.PROBLEM
        assert (findings[name].fix or "").startswith(
            f"echo 'ann - {limit}' | sudo tee -a /etc/security/limits.d/weberlink.conf"
        )


def test_in_a_container_the_engine_is_told(tmp_path: Path) -> None:
    host = machine(tmp_path, {".dockerenv": ""}, trial=lambda _request: refused("priority", "memory"))
    fixes = {each.check: each.fix or "" for each in look(rights, host)}
    assert "--ulimit rtprio=98" in fixes["scheduling"]
    assert "--ulimit memlock=-1" in fixes["memory lock"]


def test_in_a_unit_of_the_system_the_unit_is_named(tmp_path: Path) -> None:
    variables = {"USER": "weberlink", "INVOCATION_ID": "0123"}
    unit = found(tmp_path, refused("priority", "memory"), user=105, variables=variables)
    assert unit["scheduling"].fix == "in the unit, under [Service]: LimitRTPRIO=98"
    assert unit["memory lock"].fix == "in the unit, under [Service]: LimitMEMLOCK=infinity"
    desktop = found(tmp_path, refused("priority"), user=1000, variables=variables)  # started by a person's own systemd
    assert "limits.d" in (desktop["scheduling"].fix or "")


def test_what_the_file_does_not_ask_for_is_advice(tmp_path: Path) -> None:
    findings = found(tmp_path, refused("priority", "memory"), Needs(priority=0, lock_memory=False))
    assert findings["scheduling"].grade is findings["memory lock"].grade is Grade.ADVICE


def test_a_limit_that_holds_hardly_more_than_the_start_is_advice(tmp_path: Path) -> None:
    tight = found(tmp_path, TRIAL, limit=lambda _which: 70_000_000)
    assert tight["memory lock"].grade is Grade.ADVICE
    assert found(tmp_path, TRIAL, limit=lambda _which: 1_000_000_000)["memory lock"].grade is Grade.OK


def test_a_capability_makes_the_limit_no_matter(tmp_path: Path) -> None:
    host = machine(tmp_path, {"proc/self/status": "CapEff:\t0000000000004000\n"}, limit=lambda _which: 8_000_000)
    assert graded(look(rights, host))["memory lock"] == "ok"


def test_sleeping_processors_matter_where_there_is_a_deep_sleep(tmp_path: Path) -> None:
    def grade(files: dict[str, str], needs: Needs) -> str | None:
        host = machine(tmp_path, files, trial=lambda _request: refused("wakeful"))
        return graded(look(rights, host, needs)).get("idle latency")

    assert grade({}, Needs()) == "ok"
    assert grade(DEEP, Needs()) == "advice"
    assert grade(DEEP, Needs(wakeful=False)) is None


@pytest.mark.parametrize(
    ("trial", "rate_hz", "grade"),
    [
        (late(200.0), 1000.0, Grade.OK),
        (late(300.0), 1000.0, Grade.ADVICE),
        (late(200.0, missed=3), 1000.0, Grade.ADVICE),
        (late(1200.0), 1000.0, Grade.PROBLEM),
        (late(300.0), 4000.0, Grade.PROBLEM),
    ],
)
def test_punctuality_is_judged_by_the_period(tmp_path: Path, trial: Trial, rate_hz: float, grade: Grade) -> None:
    assert found(tmp_path, trial, Needs(rate_hz=rate_hz))["punctuality"].grade is grade


def test_a_trial_that_fails_is_unknown(tmp_path: Path) -> None:
    findings = found(tmp_path, Trial(failure="no more processes"))
    assert [(each.grade, each.found) for each in findings.values()] == [(Grade.UNKNOWN, "no more processes")]


def test_the_trial_asks_for_what_the_file_asks_for(tmp_path: Path) -> None:
    asked: list[Request] = []

    def trial(request: Request) -> Trial:
        asked.append(request)
        return TRIAL

    needs = Needs(priority=7, lock_memory=False, wakeful=False, cpus=(9, 1), rate_hz=500.0, encrypted=False)
    look(rights, machine(tmp_path, trial=trial), needs)
    assert asked == [Request(7, False, False, 1, 500.0, False)]  # of the two processors, the one that is there


def test_the_real_trial_answers_whatever_this_machine_grants() -> None:
    trial = run_trial(Request(priority=1, lock_memory=True, wakeful=False, cpu=None, rate_hz=200.0))
    assert trial.failure is None
    assert set(trial.grants) == set(GRANTS)
    assert trial.grants["cpu"]["granted"] is False
    assert trial.memory_bytes > 10_000_000
    assert 0 < trial.wake_ups <= 100
    assert 100 <= trial.wake_ups + trial.missed < 150  # more only if the last wake-up is late by as many ticks
    assert 0.0 <= trial.lateness_us["p50"] <= trial.lateness_us["p99"]


def test_the_real_trial_leaves_this_process_as_it_was() -> None:
    before = os.sched_getscheduler(0), os.sched_getaffinity(0)
    run_trial(Request(priority=1, lock_memory=False, wakeful=False, cpu=0, rate_hz=1000.0))
    assert (os.sched_getscheduler(0), os.sched_getaffinity(0)) == before


def test_a_child_that_fails_is_told_in_its_own_words() -> None:
    trial = run_trial(Request(priority=1000, lock_memory=False, wakeful=False, cpu=None, rate_hz=1000.0))
    assert trial.failure is not None
    assert "priority must be" in trial.failure


def test_the_child_answers_in_json(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(TypeError):
        trials.main(json.dumps({"unknown": 1}))
    assert capsys.readouterr().out == ""
