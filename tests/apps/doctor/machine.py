"""A machine made up of files and answers, on which everything is right until a test says otherwise."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from weberlink.apps.doctor import Finding, Host, Needs
from weberlink.apps.doctor.finding import Check
from weberlink.apps.doctor.host import Unreadable
from weberlink.apps.doctor.trial import Request, Trial

CPU = "sys/devices/system/cpu"
CLOCK = "sys/devices/system/clocksource/clocksource0"
GRANTED = {"granted": True, "detail": "granted"}
REFUSED = {"granted": False, "detail": "not permitted: needs something"}
GRANTS: dict[str, dict[str, bool | str]] = {
    "priority": {"granted": True, "detail": "SCHED_FIFO 50"},
    "memory": {"granted": True, "detail": "memory locked"},
    "cpu": {"granted": False, "detail": "not asked for"},
    "timer_slack": {"granted": True, "detail": "timer slack 1 ns"},
    "wakeful": {"granted": True, "detail": "processors awake"},
}
TRIAL = Trial(
    grants=GRANTS,
    memory_bytes=65_000_000,
    lateness_us={"p50": 20.0, "p99": 60.0, "max": 90.0},
    wake_ups=500,
    missed=0,
)
FILES: Mapping[str, str] = {
    "proc/version": "Linux version 6.1.0-21-rt-amd64 (debian-kernel@lists.debian.org) #1 SMP PREEMPT_RT Debian",
    "proc/cmdline": "root=/dev/sda1 quiet",
    "proc/sys/kernel/osrelease": "6.1.0-21-rt-amd64",
    "boot/config-6.1.0-21-rt-amd64": "CONFIG_PREEMPT_RT=y\nCONFIG_HZ=250\n# CONFIG_PREEMPT_NONE is not set\n",
    "sys/kernel/realtime": "1\n",
    "proc/sys/kernel/sched_rt_runtime_us": "950000\n",
    "proc/sys/kernel/sched_rt_period_us": "1000000\n",
    f"{CLOCK}/current_clocksource": "tsc\n",
    f"{CLOCK}/available_clocksource": "tsc hpet acpi_pm\n",
    f"{CPU}/isolated": "\n",
    f"{CPU}/cpu0/cpufreq/scaling_governor": "performance\n",
    f"{CPU}/cpu1/cpufreq/scaling_governor": "performance\n",
    f"{CPU}/cpu0/cpuidle/state0/name": "POLL",
    f"{CPU}/cpu0/cpuidle/state0/latency": "0",
    f"{CPU}/cpu0/cpuidle/state0/disable": "0",
    f"{CPU}/cpu0/cpuidle/state1/name": "C1",
    f"{CPU}/cpu0/cpuidle/state1/latency": "2",
    f"{CPU}/cpu0/cpuidle/state1/disable": "0",
    "proc/self/cgroup": "0::/user.slice/session-1.scope\n",
    "proc/self/status": "Name:\tpython\nCapEff:\t0000000000000000\n",
    "proc/swaps": "Filename\tType\tSize\tUsed\tPriority\n",
    "proc/net/udp": "  sl  local_address rem_address   st tx_queue rx_queue ...\n",
    "proc/net/udp6": "  sl  local_address remote_address\n",
    "sys/kernel/mm/transparent_hugepage/enabled": "always [madvise] never\n",
    "proc/sys/net/core/rmem_default": "212992\n",
    "proc/sys/net/core/rmem_max": "212992\n",
    "dev/shm/.keep": "",
    "etc/os-release": "ID=debian\n",
}


def machine(tmp_path: Path, files: Mapping[str, str | None] | None = None, **answers: Any) -> Host:
    """A host in a folder; a file that is None is not there."""
    for name, text in {**FILES, **(files or {})}.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if text is not None:
            path.write_text(text, encoding="utf-8")
    return Host(root=tmp_path, **{**_answers(), **answers})


def _answers() -> dict[str, Any]:
    def trial(_request: Request) -> Trial:
        return TRIAL

    def run(*command: str) -> tuple[int, str]:
        raise Unreadable(f"{command[0]} is not there")

    return {
        "user": 1000,
        "affinity": lambda: frozenset({0, 1}),
        "limit": lambda _which: 98,
        "resolution_ns": lambda: 1.0,
        "trial": trial,
        "which": lambda _name: None,
        "run": run,
        "bind": lambda _host, _port: None,
        "resolve": lambda _name: ["10.1.2.3"],
        "route": lambda _address: "10.1.2.1",
        "space": lambda _path: (64_000_000, 60_000_000),
        "clock_is_synchronised": lambda: True,
        "variables": {"USER": "ann"},
    }


def look(check: Check, host: Host, needs: Needs | None = None) -> list[Finding]:
    return list(check(host, needs or Needs()))


def only(check: Check, host: Host, needs: Needs | None = None) -> Finding:
    (finding,) = look(check, host, needs)
    return finding


def graded(findings: list[Finding]) -> dict[str, str]:
    """Each check's grade, in words."""
    return {each.check: each.grade.value for each in findings}
