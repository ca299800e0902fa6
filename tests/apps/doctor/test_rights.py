"""Findings on rights, and the trial in a real child process."""

import os
from dataclasses import replace
from pathlib import Path

import pytest

from tests.apps.doctor.machines import GRANTS, REFUSED, TRIAL, graded, look, machine
from tests.apps.doctor.test_checks import DEEP
from weberlink.apps.doctor import Finding, Grade, Needs
from weberlink.apps.doctor.rights import rights
from weberlink.apps.doctor.trial import RightsRequest, RightsTrial, measure, run_trial


def refused(*names: str) -> RightsTrial:
    return replace(TRIAL, grants=GRANTS | dict.fromkeys(names, REFUSED))


def late(p99: float, missed: int = 0) -> RightsTrial:
    return replace(TRIAL, lateness_us={"p50": 10.0, "p99": p99, "max": p99}, missed=missed)


def found(tmp_path: Path, trial: RightsTrial, needs: Needs | None = None, **answers: object) -> dict[str, Finding]:
    host = machine(tmp_path, trial=lambda _request: trial, **answers)
    return {each.check: each for each in look(rights, host, needs)}


def test_all_granted_is_ok(tmp_path: Path) -> None:
    findings = found(tmp_path, TRIAL, limit=lambda _which: -1)
    assert set(graded(list(findings.values())).values()) == {"ok"}
    assert set(findings) == {"scheduling", "memory lock", "idle latency", "timer slack", "punctuality"}


def test_refusal_is_a_problem_with_the_limits_line(tmp_path: Path) -> None:
    findings = found(tmp_path, refused("priority", "memory"))
    for name, limit in (("scheduling", "rtprio 98"), ("memory lock", "memlock unlimited")):
        assert findings[name].grade is Grade.PROBLEM
        assert (findings[name].fix or "").startswith(
            f"echo 'ann - {limit}' | sudo tee -a /etc/security/limits.d/weberlink.conf"
        )


def test_fix_in_a_container_names_engine_options(tmp_path: Path) -> None:
    host = machine(tmp_path, {".dockerenv": ""}, trial=lambda _request: refused("priority", "memory"))
    fixes = {each.check: each.fix or "" for each in look(rights, host)}
    assert "--ulimit rtprio=98" in fixes["scheduling"]
    assert "--ulimit memlock=-1" in fixes["memory lock"]


def test_fix_in_a_system_unit_names_the_unit(tmp_path: Path) -> None:
    variables = {"USER": "weberlink", "INVOCATION_ID": "0123"}
    unit = found(tmp_path, refused("priority", "memory"), user=105, variables=variables)
    assert unit["scheduling"].fix == "in the unit, under [Service]: LimitRTPRIO=98"
    assert unit["memory lock"].fix == "in the unit, under [Service]: LimitMEMLOCK=infinity"
    desktop = found(tmp_path, refused("priority"), user=1000, variables=variables)  # started by a person's own systemd
    assert "limits.d" in (desktop["scheduling"].fix or "")


def test_rights_not_asked_for_are_advice(tmp_path: Path) -> None:
    findings = found(tmp_path, refused("priority", "memory"), Needs(priority=0, lock_memory=False))
    assert findings["scheduling"].grade is findings["memory lock"].grade is Grade.ADVICE


def test_tight_memory_limit_is_advice(tmp_path: Path) -> None:
    tight = found(tmp_path, TRIAL, limit=lambda _which: 70_000_000)
    assert tight["memory lock"].grade is Grade.ADVICE
    assert found(tmp_path, TRIAL, limit=lambda _which: 1_000_000_000)["memory lock"].grade is Grade.OK


def test_ipc_lock_capability_overrides_the_limit(tmp_path: Path) -> None:
    host = machine(tmp_path, {"proc/self/status": "CapEff:\t0000000000004000\n"}, limit=lambda _which: 8_000_000)
    assert graded(look(rights, host))["memory lock"] == "ok"


def test_idle_latency_matters_with_deep_idle_states(tmp_path: Path) -> None:
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
def test_punctuality_is_graded_by_the_period(tmp_path: Path, trial: RightsTrial, rate_hz: float, grade: Grade) -> None:
    assert found(tmp_path, trial, Needs(rate_hz=rate_hz))["punctuality"].grade is grade


def test_failed_trial_is_unknown(tmp_path: Path) -> None:
    findings = found(tmp_path, RightsTrial(failure="no more processes"))
    assert [(each.grade, each.found) for each in findings.values()] == [(Grade.UNKNOWN, "no more processes")]


def test_trial_asks_for_what_the_file_asks_for(tmp_path: Path) -> None:
    asked: list[RightsRequest] = []

    def trial(request: RightsRequest) -> RightsTrial:
        asked.append(request)
        return TRIAL

    needs = Needs(priority=7, lock_memory=False, wakeful=False, cpus=(9, 1), rate_hz=500.0, encrypted=False)
    look(rights, machine(tmp_path, trial=trial), needs)
    assert asked == [RightsRequest(7, False, False, 1, 500.0, False)]  # of the two processors, the one that is there


def test_real_trial_reports_grants_and_changes_nothing_here() -> None:
    before = os.sched_getscheduler(0), os.sched_getaffinity(0)
    trial = run_trial(RightsRequest(priority=1, lock_memory=True, wakeful=False, cpu=None, rate_hz=200.0))
    assert trial.failure is None
    assert set(trial.grants) == set(GRANTS)
    assert trial.grants["cpu"]["granted"] is False
    assert trial.memory_bytes > 10_000_000
    assert 0.0 <= trial.lateness_us["p50"] <= trial.lateness_us["p99"]
    assert (os.sched_getscheduler(0), os.sched_getaffinity(0)) == before


def test_every_deadline_is_a_wake_up_or_missed() -> None:
    lateness, missed = measure(200.0)
    assert 0 < len(lateness) <= 100
    assert 100 <= len(lateness) + missed < 150  # more only if the last wake-up is late by as many ticks


def test_failure_of_the_child_is_reported() -> None:
    trial = run_trial(RightsRequest(priority=1000, lock_memory=False, wakeful=False, cpu=None, rate_hz=1000.0))
    assert trial.failure is not None
    assert "priority must be" in trial.failure
