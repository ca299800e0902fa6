"""Facts of this host that influence the wake-up latency, from the files of the kernel."""

import os
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

WORDS = (
    "isolcpus",
    "nohz_full",
    "rcu_nocbs",
    "irqaffinity",
    "idle",
    "preempt",
    "threadirqs",
    "mitigations",
    "skew_tick",
    "intel_idle.max_cstate",
    "processor.max_cstate",
    "intel_pstate",
    "tsc",
    "clocksource",
)
"""Parameters of the kernel's command line that influence timing."""

CPUS = "sys/devices/system/cpu"


def host(root: Path = Path("/")) -> dict[str, Any]:
    """The facts; None where the kernel does not tell.

    Args:
        root: of the files of the kernel.
    """
    return {
        "kernel": platform.release(),
        "preemption": preemption(platform.version(), root),
        "command_line": [word for word in _read(root / "proc/cmdline").split() if word.partition("=")[0] in WORDS],
        "governors": sorted({_read(path) for path in (root / CPUS).glob("cpu[0-9]*/cpufreq/scaling_governor")}) or None,
        "idle_driver": _read(root / CPUS / "cpuidle/current_driver") or None,
        "isolated_cpus": _read(root / CPUS / "isolated") or None,
        "nohz_full_cpus": _read(root / CPUS / "nohz_full") or None,
        "clock_source": _read(root / "sys/devices/system/clocksource/clocksource0/current_clocksource") or None,
        "virtual_machine": "hypervisor" in _read(root / "proc/cpuinfo"),
        "realtime_share": _realtime_share(root),
        "load_average": list(os.getloadavg()),
    }


def preemption(version: str, root: Path) -> str:
    """Preemption model of the kernel: PREEMPT_RT, PREEMPT_DYNAMIC, PREEMPT or none."""
    if _read(root / "sys/kernel/realtime") == "1":
        return "PREEMPT_RT"
    words = [word for word in version.split() if word.startswith("PREEMPT")]
    return words[0] if words else "none"


def in_words(facts: Mapping[str, Any]) -> str:
    """The facts as one line."""
    load = "/".join(f"{value:.2f}" for value in facts["load_average"])
    governors = ", ".join(facts["governors"]) if facts["governors"] else "unknown"
    parts = [
        f"kernel {facts['preemption']}" + (" in a virtual machine" if facts["virtual_machine"] else ""),
        f"governor {governors}",
        f"idle {facts['idle_driver'] or 'unknown'}",
        f"isolated CPUs {facts['isolated_cpus'] or 'none'}",
        f"clock {facts['clock_source'] or 'unknown'}",
        f"load before {load}",
    ]
    return "; ".join(parts)


class Stolen(NamedTuple):
    """Time that all processors have been through, and that the host of a virtual machine took of it [kernel ticks]."""

    elapsed: int
    stolen: int

    def share_until(self, later: "Stolen") -> float | None:
        """Share of the time between two readings that was stolen; None without any time between them."""
        elapsed = later.elapsed - self.elapsed
        return (later.stolen - self.stolen) / elapsed if elapsed > 0 else None


def stolen(root: Path = Path("/")) -> Stolen:
    """Read it; 0 of 0 where the kernel does not tell."""
    times = [int(word) for word in _read(root / "proc/stat").partition("\n")[0].split()[1:]]
    # After user, nice, system, idle, iowait, irq and softirq; the two for guests are contained in user and nice.
    return Stolen(sum(times[:8]), times[7] if len(times) > 7 else 0)


def during(share: float | None, load: tuple[float, float, float] | None = None) -> str:
    """What disturbed a run, as a few words."""
    one = (load or os.getloadavg())[0]
    return f"steal during the run {'unknown' if share is None else f'{100 * share:.2f} %'}; load after {one:.2f}"


def _realtime_share(root: Path) -> float | None:
    """Share of time that real-time processes may use; None for all, or if unknown."""
    runtime, period = (_read(root / f"proc/sys/kernel/sched_rt_{name}_us") for name in ("runtime", "period"))
    if not runtime or not period or int(runtime) < 0:
        return None
    return int(runtime) / int(period)


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""
