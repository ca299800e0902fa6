"""The trials in real child processes."""

import os

import pytest

from tests.apps.doctor.machines import GRANTS
from weberlink.apps.doctor.trial import PAIRS, host_trial, measure, run_host_trial, run_rights_trial


def test_real_trial_reports_grants_and_changes_nothing_here() -> None:
    before = os.sched_getscheduler(0), os.sched_getaffinity(0)
    trial = run_rights_trial(priority=1, lock_memory=True, wakeful=False, cpu=None, rate_hz=200.0)
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


def test_real_trial_of_the_host_measures_or_says_why_not() -> None:
    before = os.sched_getscheduler(0), os.sched_getaffinity(0)
    result = run_host_trial(priority=1, processors=sorted(os.sched_getaffinity(0)), rate_hz=1000.0)
    assert (os.sched_getscheduler(0), os.sched_getaffinity(0)) == before
    if result.failure is not None:
        assert "SCHED_FIFO 1 not permitted" in result.failure
        return
    assert len(result.asleep) == PAIRS
    assert len(result.awake) == (0 if result.not_awake else PAIRS)
    for each in [*result.asleep, *result.awake]:
        assert each["p99_us"] is not None and each["p99_us"] > 0.0
        assert each["missed"] is not None and 0.0 <= each["missed"] < 1.0
        assert each["steal"] is None or 0.0 <= each["steal"] <= 1.0


def test_failure_of_the_child_is_reported() -> None:
    with pytest.raises(ValueError, match="priority must be"):
        host_trial(1000, [0], 1000.0)
    rights = run_rights_trial(priority=1000, lock_memory=False, wakeful=False, cpu=None, rate_hz=1000.0)
    for failure in (run_host_trial(priority=1000, processors=[0], rate_hz=1000.0).failure, rights.failure):
        assert failure is not None
        assert "priority must be" in failure
