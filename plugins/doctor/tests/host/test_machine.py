"""Reading this machine: files, system calls, tools, and the trials in child processes."""

import os
from pathlib import Path

import pytest

from plugins.doctor.tests.host.machines import GRANTS, machine
from weberlink_doctor.host.machine import Machine, Unreadable
from weberlink_doctor.host.trial import PAIRS, session_trial


def test_files_are_read_or_say_why_not(tmp_path: Path) -> None:
    host = machine(tmp_path, {"proc/here": " 17\n", "proc/text": "much", **{f"sys/cpu{n}/x": "" for n in (10, 2, 1)}})
    assert (host.read("/proc/here"), host.number("proc/here"), host.in_container) == ("17", 17, False)
    assert host.find("/sys/cpu[0-9]*/x") == ["/sys/cpu1/x", "/sys/cpu2/x", "/sys/cpu10/x"]
    for path in ("/proc/none", "/proc", "/proc/text"):
        with pytest.raises(Unreadable):
            host.number(path)
    assert machine(tmp_path, {"run/.containerenv": ""}).in_container


def test_real_trials_measure_or_say_why_not_and_change_nothing_here() -> None:
    before = os.sched_getscheduler(0), os.sched_getaffinity(0)
    trial = Machine().rights_trial(priority=1, lock_memory=True, wakeful=False, cpu=None, rate_hz=200.0)
    assert (trial.failure, set(trial.grants), trial.grants["cpu"]["granted"]) == (None, set(GRANTS), False)
    assert 0.0 <= trial.lateness_us["p50"] <= trial.lateness_us["p99"]
    result = Machine().host_trial(priority=1, processors=sorted(os.sched_getaffinity(0)), rate_hz=1000.0)
    assert (os.sched_getscheduler(0), os.sched_getaffinity(0)) == before
    if result.failure is not None:
        assert "SCHED_FIFO 1 not permitted" in result.failure
        return
    assert (len(result.asleep), len(result.awake)) == (PAIRS, 0 if result.not_awake else PAIRS)
    for each in [*result.asleep, *result.awake]:
        assert (each["p99_us"] or 0.0) > 0.0
        assert 0.0 <= (each["missed"] or 0.0) < 1.0


def test_a_session_is_tried_at_its_rate_with_its_settings_or_says_why_not() -> None:
    trial = session_trial({"rate_hz": 200.0, "realtime.priority": 0})
    assert (trial.failure, trial.p99_us > 0.0, 0.0 <= trial.missed < 1.0) == (None, True, True)
    assert "realtime.priority" in str(session_trial({"realtime.priority": 1000}).failure)


def test_failure_of_the_child_is_reported() -> None:
    failure = Machine().host_trial(priority=1000, processors=[0], rate_hz=1000.0).failure
    assert "priority must be" in str(failure)
