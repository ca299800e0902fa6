"""Preemption, timers and the brake on real-time tasks, on made-up kernels."""

import gzip
from pathlib import Path

import pytest

from tests.apps.doctor.machine import machine, only
from weberlink.apps.doctor import Grade, Needs
from weberlink.apps.doctor.kernel import preemption, throttling, timers

DYNAMIC = "Linux version 6.1.0-21-amd64 (debian-kernel@lists.debian.org) #1 SMP PREEMPT_DYNAMIC Debian 6.1.90-1"
NOT_RT = {"sys/kernel/realtime": None, "proc/version": DYNAMIC}
DEBUG = "sys/kernel/debug/sched/preempt"


def test_a_real_time_kernel_is_fine(tmp_path: Path) -> None:
    found = only(preemption, machine(tmp_path))
    assert (found.grade, found.fix) == (Grade.OK, None)
    assert "6.1.0-21-rt-amd64" in found.found


def test_a_real_time_kernel_without_the_file_is_known_by_its_version(tmp_path: Path) -> None:
    assert only(preemption, machine(tmp_path, {"sys/kernel/realtime": None})).grade is Grade.OK


@pytest.mark.parametrize(
    ("models", "grade"),
    [
        ("none voluntary (full)", Grade.OK),
        ("full (lazy)", Grade.OK),
        ("none (voluntary) full", Grade.ADVICE),
        ("(none) voluntary full lazy", Grade.ADVICE),
    ],
)
def test_the_model_in_use_counts_on_a_dynamic_kernel(tmp_path: Path, models: str, grade: Grade) -> None:
    found = only(preemption, machine(tmp_path, NOT_RT | {DEBUG: models}))
    assert found.grade is grade
    if grade is Grade.ADVICE:
        assert found.fix is not None
        assert found.fix.startswith("echo full | sudo tee /sys/kernel/debug/sched/preempt ")


def test_without_the_debugging_file_the_kernels_parameter_counts_then_how_it_was_built(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    asked = machine(tmp_path / "a", NOT_RT | {"proc/cmdline": "quiet preempt=full"})
    assert only(preemption, asked).grade is Grade.OK
    (tmp_path / "b").mkdir()
    config = {"boot/config-6.1.0-21-rt-amd64": "CONFIG_PREEMPT_VOLUNTARY=y\nCONFIG_PREEMPT_DYNAMIC=y\n"}
    built = only(preemption, machine(tmp_path / "b", NOT_RT | config))
    assert (built.grade, built.fix) == (Grade.ADVICE, "kernel parameter preempt=full, then restart")


def test_a_kernel_whose_model_nobody_says_is_unknown_with_a_way_to_know(tmp_path: Path) -> None:
    found = only(preemption, machine(tmp_path, NOT_RT | {"boot/config-6.1.0-21-rt-amd64": None}))
    assert found.grade is Grade.UNKNOWN
    assert found.fix == "sudo cat /sys/kernel/debug/sched/preempt"


@pytest.mark.parametrize(
    ("system", "words"),
    [
        ("ID=debian", "sudo apt install linux-image-rt-amd64"),
        ("NAME=x\nID=ubuntu", "sudo pro enable realtime-kernel"),
        ("ID=arch", "PREEMPT_RT kernel of this distribution"),
    ],
)
def test_a_kernel_that_cannot_be_switched_gets_the_package_of_its_distribution(
    tmp_path: Path, system: str, words: str
) -> None:
    files = {
        "sys/kernel/realtime": None,
        "proc/version": "Linux version 5.10.0 (x) #1 SMP Debian",
        "boot/config-6.1.0-21-rt-amd64": "CONFIG_PREEMPT_NONE=y\n",
        "etc/os-release": system,
    }
    found = only(preemption, machine(tmp_path, files))
    assert found.grade is Grade.ADVICE
    assert words in (found.fix or "")


def test_the_configuration_may_be_in_proc(tmp_path: Path) -> None:
    host = machine(tmp_path, NOT_RT | {"boot/config-6.1.0-21-rt-amd64": None})
    (tmp_path / "proc/config.gz").write_bytes(gzip.compress(b"CONFIG_PREEMPT_NONE=y\nCONFIG_HZ=100\n"))
    assert "preemption none" in only(preemption, host).found
    assert "100 Hz" in only(timers, host).found


def test_coarse_timers_are_a_problem(tmp_path: Path) -> None:
    assert only(timers, machine(tmp_path)).grade is Grade.OK
    found = only(timers, machine(tmp_path, resolution_ns=lambda: 4e6))
    assert found.grade is Grade.PROBLEM
    assert "4 ms" in found.found


@pytest.mark.parametrize(
    ("runtime", "priority", "grade"),
    [
        ("-1", 50, Grade.OK),
        ("950000", 50, Grade.OK),
        ("100000", 50, Grade.ADVICE),
        ("0", 50, Grade.PROBLEM),
        ("0", 0, Grade.OK),
    ],
)
def test_a_small_share_for_real_time_tasks_counts_where_it_is_asked_for(
    tmp_path: Path, runtime: str, priority: int, grade: Grade
) -> None:
    host = machine(tmp_path, {"proc/sys/kernel/sched_rt_runtime_us": runtime})
    found = only(throttling, host, Needs(priority=priority))
    assert found.grade is grade
    assert (found.fix is not None) == (grade is not Grade.OK)
    if found.fix is not None:
        assert found.fix == "sudo sysctl -w kernel.sched_rt_runtime_us=950000"
