"""Findings on the host, and its trial in a real child process."""

import os
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.apps.doctor.machines import HOST, STRETCH, graded, look, machine
from weberlink.apps.doctor import Finding, Grade, Machine, Needs
from weberlink.apps.doctor.host import awake_is_better, host
from weberlink.apps.doctor.host_trial import PAIRS, HostRequest, HostTrial, run_host_trial, trial

PERIOD_US = 1000.0
Figures = Sequence[float | None]


def stretches(
    p99_us: Figures = (60.0,) * 4, steal: Figures = (0.001,) * 4, missed: float = 0.0
) -> list[dict[str, float | None]]:
    return [{"p99_us": late, "missed": missed, "steal": taken} for late, taken in zip(p99_us, steal, strict=True)]


def found(tmp_path: Path, result: HostTrial, needs: Needs | None = None) -> dict[str, Finding]:
    return {each.check: each for each in look(host, machine(tmp_path, host_trial=lambda _request: result), needs)}


@pytest.mark.parametrize(
    ("asleep", "awake", "better"),
    [
        (stretches(), stretches(), None),
        (stretches([200.0] * 4), stretches([60.0] * 4), True),
        (stretches([60.0] * 4), stretches([200.0] * 4), False),
        (stretches([90.0] * 4), stretches([60.0] * 4), None),  # within the margin
        (stretches([60.0, 60.0, 60.0, 900.0]), stretches([70.0, 60.0, 60.0, 60.0]), None),  # one bad moment of the host
        (stretches(steal=[0.0] * 4), stretches(steal=[0.05, 0.03, 0.0, 0.04]), False),
        (stretches(steal=[0.0, 0.0, 0.06, 0.0]), stretches(steal=[0.1] * 3 + [0.05]), False),
        (stretches(steal=[0.0, 0.0, 0.2, 0.0]), stretches(steal=[0.15] * 4), None),  # not in every pair
        (stretches([200.0] * 4, [0.0] * 4), stretches([60.0] * 4, [0.1] * 4), True),  # lateness decides
        (stretches(steal=[None] * 4), stretches(steal=[None] * 4), None),
    ],
)
def test_only_a_clear_difference_decides(
    asleep: list[dict[str, float | None]], awake: list[dict[str, float | None]], better: bool | None
) -> None:
    assert awake_is_better(HostTrial(asleep, awake), PERIOD_US) is better
    if better is not None:
        assert awake_is_better(HostTrial(awake, asleep), PERIOD_US) is not better


@pytest.mark.parametrize(("wakeful", "grade"), [(True, Grade.ADVICE), (False, Grade.OK)])
def test_a_setting_that_is_worse_is_advised_against(tmp_path: Path, wakeful: bool, grade: Grade) -> None:
    result = HostTrial(stretches(steal=[0.0] * 4), stretches(steal=[0.009, 0.03, 0.03, 0.03]))
    finding = found(tmp_path, result, Needs(wakeful=wakeful))["wakeful"]
    assert finding.grade is grade
    assert finding.fix == ("in the file: realtime: {wakeful: false}" if wakeful else None)


def test_the_share_of_the_host_is_that_of_the_setting_in_use(tmp_path: Path) -> None:
    result = HostTrial(stretches(missed=0.0), stretches(missed=0.03))
    assert graded(list(found(tmp_path, result, Needs(wakeful=True)).values()))["host"] == "advice"
    assert graded(list(found(tmp_path, result, Needs(wakeful=False)).values()))["host"] == "ok"
    busy = HostTrial(stretches(steal=[0.2] * 4), stretches(steal=[0.2] * 4))
    assert found(tmp_path, busy)["host"].grade is Grade.ADVICE


def test_what_could_not_be_measured_is_unknown(tmp_path: Path) -> None:
    refused = found(tmp_path, HostTrial(failure="SCHED_FIFO 50 not permitted: needs something"))
    assert [(each.grade, each.check) for each in refused.values()] == [(Grade.UNKNOWN, "host")]
    partly = found(tmp_path, HostTrial([STRETCH] * 4, [], "/dev/cpu_dma_latency: Permission denied"))
    assert graded(list(partly.values())) == {"host": "ok", "wakeful": "unknown"}
    assert "Permission denied" in partly["wakeful"].found
    uncounted = found(tmp_path, HostTrial(stretches(steal=[None] * 4), stretches(steal=[None] * 4)))
    assert graded(list(uncounted.values())) == {"host": "ok", "wakeful": "ok"}


def test_the_processors_of_the_file_are_measured(tmp_path: Path) -> None:
    asked: list[HostRequest] = []

    def host_trial(request: HostRequest) -> HostTrial:
        asked.append(request)
        return HOST

    look(host, machine(tmp_path, host_trial=host_trial), Needs(priority=0, rate_hz=500.0, cpus=(1, 7)))
    look(host, machine(tmp_path, host_trial=host_trial), Needs())
    assert asked == [HostRequest(1, [1], 500.0), HostRequest(51, [0, 1], 1000.0)]


def test_real_trial_measures_or_says_why_not() -> None:
    before = os.sched_getscheduler(0), os.sched_getaffinity(0)
    result = Machine().host_trial(HostRequest(1, sorted(os.sched_getaffinity(0)), 1000.0))
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
        trial(HostRequest(1000, [0], 1000.0))
    failure = run_host_trial(HostRequest(1000, [0], 1000.0)).failure
    assert failure is not None
    assert "priority must be" in failure
