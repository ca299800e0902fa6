"""An emulated machine for the checks, on which everything is right unless a test changes it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from weberlink_doctor.host.checks import CHECKS
from weberlink_doctor.host.examination import examine
from weberlink_doctor.host.machine import Machine, Unreadable
from weberlink_doctor.host.trial import HostTrial, RightsTrial, SessionTrial, Stretch
from weberlink_doctor.report import USUAL, Finding, Needs

CPU = "sys/devices/system/cpu"
CLOCK = "sys/devices/system/clocksource/clocksource0"
REFUSED = {"granted": False, "detail": "not permitted: needs something"}
GRANTS: dict[str, dict[str, bool | str]] = {
    "priority": {"granted": True, "detail": "SCHED_FIFO 50"},
    "memory": {"granted": True, "detail": "memory locked"},
    "cpu": {"granted": False, "detail": "not asked for"},
    "timer_slack": {"granted": True, "detail": "timer slack 1 ns"},
    "wakeful": {"granted": True, "detail": "processors awake"},
}
TRIAL = RightsTrial(
    grants=GRANTS, memory_bytes=65_000_000, lateness_us={"p50": 20.0, "p99": 60.0, "max": 90.0}, missed=0
)
STRETCH: Stretch = {"p99_us": 60.0, "missed": 0.0, "steal": 0.001}
HOST = HostTrial(asleep=[STRETCH] * 4, awake=[STRETCH] * 4)
BUILD = {"number": "3.14.0", "is_debug": False, "is_free_threaded": False, "is_dev_mode": False}


def idle_state(number: int, name: str, latency_us: int) -> dict[str, str]:
    values = {"name": name, "latency": str(latency_us), "disable": "0"}
    return {f"{CPU}/cpu0/cpuidle/state{number}/{file}": text for file, text in values.items()}


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
    **{f"{CPU}/cpu{number}/cpufreq/scaling_governor": "performance\n" for number in (0, 1)},
    **idle_state(0, "POLL", 0),
    **idle_state(1, "C1", 2),
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


def machine(tmp_path: Path, files: Mapping[str, str | None] | None = None, **answers: Any) -> Machine:
    """A machine in a folder; a file that is None does not exist."""
    for name, text in {**FILES, **(files or {})}.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if text is not None:
            path.write_text(text, encoding="utf-8")
    here = Machine(tmp_path)
    for name, answer in {**_answers(), **answers}.items():
        setattr(here, name, answer)
    return here


def _answers() -> dict[str, Any]:
    def run_tool(*command: str) -> tuple[int, str]:
        raise Unreadable(f"{command[0]} is not there")

    return {
        "user": 1000,
        "affinity": lambda: frozenset({0, 1}),
        "limit": lambda _which: -1,
        "resolution_ns": lambda: 1.0,
        "rights_trial": lambda **_: TRIAL,
        "host_trial": lambda **_: HOST,
        "session_trial": lambda **_: SessionTrial(p99_us=40.0),
        "drivers": tuple,
        "python": lambda: BUILD,
        "version": lambda _package: "1.0",
        "which": lambda _name: None,
        "run": run_tool,
        "bind": lambda _host, _port: None,
        "resolve": lambda _name: ["10.1.2.3"],
        "route": lambda _address: "10.1.2.1",
        "space": lambda _path: (64_000_000, 60_000_000),
        "clock_is_synchronised": lambda: True,
        "variables": {"USER": "ann"},
    }


ROWS = {
    **dict.fromkeys(("scheduling", "memory lock", "idle latency", "timer slack", "punctuality"), "rights"),
    **dict.fromkeys(("driver", "device"), "devices"),
    **dict.fromkeys(("Python", "build", "uvloop", "guests"), "software"),
    "wakeful": "host",
}
"""Rows of the table by the name of their findings, where that is another one."""


def asking(file: str | None = None, **settings: Any) -> Needs:
    """What is usual, but for these settings of a file."""
    changed = {
        name: getattr(USUAL, name).model_copy(update=value) if isinstance(value, dict) else value
        for name, value in settings.items()
    }
    return Needs(USUAL.model_copy(update=changed), file=None if file is None else Path(file))


def look(check: str, here: Machine, needs: Needs | None = None) -> Finding:
    """The finding of a check."""
    rows = [each for each in CHECKS if each.name == ROWS.get(check, check)]
    (found,) = (each for each in examine(needs or Needs(), here, rows).findings if each.check == check)
    return found
