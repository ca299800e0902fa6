"""Processors: how many, for whom, how fast, how deeply asleep, and what a control group leaves of them."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.apps.doctor.machine import CPU, graded, look, machine, only
from weberlink.apps.doctor import Grade, Needs
from weberlink.apps.doctor.processors import cpu_list, cpu_quota, governor, idle_states, isolation, processors

DEEP = {
    f"{CPU}/cpu0/cpuidle/state2/name": "C6",
    f"{CPU}/cpu0/cpuidle/state2/latency": "133",
    f"{CPU}/cpu0/cpuidle/state2/disable": "0",
}


@given(st.sets(st.integers(0, 300)))
def test_sets_of_processors_are_read_as_the_kernel_writes_them(numbers: set[int]) -> None:
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and runs[-1][-1] == number - 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    text = ",".join(f"{run[0]}-{run[-1]}" if len(run) > 1 else str(run[0]) for run in runs)
    assert cpu_list(text) == numbers
    assert cpu_list(f"{text}\n") == numbers


def test_a_file_that_pins_to_a_processor_that_is_not_there_is_a_problem(tmp_path: Path) -> None:
    found = only(processors, machine(tmp_path), Needs(cpus=(1, 7)))
    assert found.grade is Grade.PROBLEM
    assert "slave on 7" in found.found
    assert "0, 1" in (found.fix or "")


def test_only_the_side_that_runs_here_counts(tmp_path: Path) -> None:
    assert only(processors, machine(tmp_path), Needs(cpus=(1, 7), sides=("master",))).grade is Grade.OK


def test_one_processor_for_two_daemons_is_advice(tmp_path: Path) -> None:
    alone = machine(tmp_path, affinity=lambda: frozenset({0}))
    assert only(processors, alone).grade is Grade.ADVICE
    assert only(processors, alone, Needs(sides=("slave",))).grade is Grade.OK
    assert only(processors, machine(tmp_path), Needs(cpus=(1, 1))).grade is Grade.ADVICE


def test_pinning_and_isolation_belong_together(tmp_path: Path) -> None:
    def found(isolated: str, cpus: tuple[int, int] | None) -> tuple[Grade, str | None]:
        finding = only(isolation, machine(tmp_path, {f"{CPU}/isolated": isolated}), Needs(cpus=cpus))
        return finding.grade, finding.fix

    assert found("", None) == (Grade.OK, None)
    assert found("2-3", (2, 3)) == (Grade.OK, None)
    assert found("2-3", None) == (Grade.ADVICE, "in the file: realtime: {cpus: [2, 3]}")
    assert found("", (2, 3)) == (Grade.ADVICE, "kernel parameter isolcpus=2,3, then restart")
    assert found("2", (2, 3)) == (Grade.ADVICE, "kernel parameter isolcpus=2,3, then restart")


def test_one_processor_that_saves_power_is_enough_for_advice(tmp_path: Path) -> None:
    assert only(governor, machine(tmp_path)).grade is Grade.OK
    found = only(governor, machine(tmp_path, {f"{CPU}/cpu1/cpufreq/scaling_governor": "schedutil"}))
    assert found.grade is Grade.ADVICE
    assert found.fix == f"echo performance | sudo tee /{CPU}/cpu*/cpufreq/scaling_governor"


def test_a_machine_without_frequency_scaling_is_fine(tmp_path: Path) -> None:
    none = {f"{CPU}/cpu{number}/cpufreq/scaling_governor": None for number in (0, 1)}
    assert only(governor, machine(tmp_path, none)).grade is Grade.OK


def test_a_deep_sleep_is_advice_unless_daemons_ask_for_less(tmp_path: Path) -> None:
    deep = machine(tmp_path, DEEP)
    asleep = only(idle_states, deep, Needs(wakeful=False))
    assert (asleep.grade, asleep.fix) == (Grade.ADVICE, "in the file: realtime: {wakeful: true}")
    assert "C6 (133 us)" in asleep.found
    assert only(idle_states, deep, Needs(wakeful=True)).grade is Grade.OK
    assert only(idle_states, deep, Needs(wakeful=False, rate_hz=100.0)).grade is Grade.OK  # a tick of 10 ms
    off = machine(tmp_path, DEEP | {f"{CPU}/cpu0/cpuidle/state2/disable": "1"})
    assert only(idle_states, off, Needs(wakeful=False)).grade is Grade.OK


def test_a_quota_of_any_group_above_counts(tmp_path: Path) -> None:
    group = "sys/fs/cgroup/user.slice"
    assert graded(look(cpu_quota, machine(tmp_path))) == {"cpu quota": "ok"}
    free = machine(tmp_path, {f"{group}/session-1.scope/cpu.max": "max 100000"})
    assert graded(look(cpu_quota, free)) == {"cpu quota": "ok"}
    held = only(cpu_quota, machine(tmp_path, {f"{group}/cpu.max": "50000 100000"}))
    assert held.grade is Grade.ADVICE
    assert "50 %" in held.found


def test_a_group_of_version_1_has_a_quota_and_a_real_time_budget(tmp_path: Path) -> None:
    group = "sys/fs/cgroup/cpu/box"
    files = {
        "proc/self/cgroup": "3:cpuacct:/\n1:cpu:/box\n0::/\n",
        f"{group}/cpu.cfs_quota_us": "150000",
        f"{group}/cpu.cfs_period_us": "100000",
        f"{group}/cpu.rt_runtime_us": "0",
    }
    findings = look(cpu_quota, machine(tmp_path, files))
    assert graded(findings) == {"cpu quota": "advice", "real-time group": "problem"}
    assert "150 %" in findings[0].found
    assert f"/{group}/cpu.rt_runtime_us" in (findings[1].fix or "")
    assert graded(look(cpu_quota, machine(tmp_path, files), Needs(priority=0))) == {"cpu quota": "advice"}
    files[f"{group}/cpu.cfs_quota_us"] = "-1"
    files[f"{group}/cpu.rt_runtime_us"] = "950000"
    assert graded(look(cpu_quota, machine(tmp_path, files))) == {"cpu quota": "ok"}


@pytest.mark.parametrize("text", ["", "x", "1-", "-3"])
def test_nonsense_in_a_set_of_processors_is_no_processor(text: str) -> None:
    assert cpu_list(text) == frozenset()
