"""Facts of a machine, read from files as its kernel would have them."""

from pathlib import Path

from benchmarks.host import host, in_words, preemption


def write(root: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def test_a_tuned_machine(tmp_path: Path) -> None:
    cpus = "sys/devices/system/cpu"
    write(
        tmp_path,
        {
            "proc/cmdline": "quiet isolcpus=2,3 root=/dev/secret nohz_full=2,3 console=ttyS0 idle=poll\n",
            "proc/cpuinfo": "flags\t: fpu tsc\n",
            "proc/sys/kernel/sched_rt_runtime_us": "-1\n",
            "proc/sys/kernel/sched_rt_period_us": "1000000\n",
            "sys/kernel/realtime": "1\n",
            f"{cpus}/isolated": "2-3\n",
            f"{cpus}/nohz_full": "2-3\n",
            f"{cpus}/cpu0/cpufreq/scaling_governor": "powersave\n",
            f"{cpus}/cpu1/cpufreq/scaling_governor": "performance\n",
            f"{cpus}/cpu2/cpufreq/scaling_governor": "performance\n",
            f"{cpus}/cpuidle/current_driver": "intel_idle\n",
            "sys/devices/system/clocksource/clocksource0/current_clocksource": "tsc\n",
        },
    )
    facts = host(tmp_path)
    assert facts["preemption"] == "PREEMPT_RT"
    assert facts["command_line"] == ["isolcpus=2,3", "nohz_full=2,3", "idle=poll"]
    assert facts["governors"] == ["performance", "powersave"]
    assert facts["isolated_cpus"] == "2-3"
    assert facts["virtual_machine"] is False
    assert facts["realtime_share"] is None
    assert "isolated CPUs 2-3" in in_words(facts)
    assert "governor performance, powersave" in in_words(facts)


def test_a_kernel_that_says_nothing(tmp_path: Path) -> None:
    facts = host(tmp_path)
    assert facts["governors"] is facts["isolated_cpus"] is facts["clock_source"] is facts["realtime_share"] is None
    assert facts["command_line"] == []
    assert "governor not said" in in_words(facts)


def test_a_share_for_real_time_processes(tmp_path: Path) -> None:
    write(
        tmp_path, {f"proc/sys/kernel/sched_rt_{name}_us": f"{us}" for name, us in (("runtime", 950), ("period", 1000))}
    )
    assert host(tmp_path)["realtime_share"] == 0.95


def test_preemption_is_read_from_the_version(tmp_path: Path) -> None:
    assert preemption("#1 SMP PREEMPT_DYNAMIC Debian 6.1", tmp_path) == "PREEMPT_DYNAMIC"
    assert preemption("#1 SMP Debian 6.1", tmp_path) == "none"
