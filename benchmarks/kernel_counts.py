"""What the kernel and the processor count of running processes, by `perf stat`: system calls, and cache misses.

A virtual machine often has no counters of the processor, and a user may not be permitted to count. What is not counted
is None.
"""

import shutil
import subprocess
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass

from benchmarks.arrangement import BenchError

ALL_CALLS = "raw_syscalls:sys_enter"
CALLS = ("epoll_wait", "epoll_pwait", "read", "recvfrom", "sendto", "futex", "timerfd_settime", "epoll_ctl")
"""System calls that are counted by name, of those that this kernel has."""
SWITCHES, MISSES = "context-switches", "cache-misses"
COUNT_LIMIT_S = 20.0
"""Time that counting may take beyond its duration."""

Counts = dict[str, float | None]
"""By event; None for what is not counted here."""


@dataclass(frozen=True)
class KernelCounts:
    """Events of a tick of each side, and why there are none."""

    per_tick: Mapping[str, Counts]
    complaint: str | None = None

    def calls(self, side: str) -> float | None:
        """System calls of a tick."""
        return self.per_tick.get(side, {}).get(ALL_CALLS)

    def misses(self, side: str) -> float | None:
        """Cache misses of a tick."""
        return self.per_tick.get(side, {}).get(MISSES)

    def named(self, side: str) -> dict[str, float]:
        """The system calls of a tick by name, most frequent first; `other` for the rest."""
        counts = self.per_tick.get(side, {})
        named = {name: value for name in CALLS if (value := counts.get(_event(name)))}
        total = counts.get(ALL_CALLS)
        if total is None:
            return {}
        return dict(sorted(named.items(), key=lambda item: -item[1])) | {"other": max(0.0, total - sum(named.values()))}


def _event(call: str) -> str:
    return f"syscalls:sys_enter_{call}"


EVENTS = (ALL_CALLS, *map(_event, CALLS), SWITCHES, MISSES)


def count(pids: Mapping[str, int], duration_s: float, rate_hz: float) -> KernelCounts:
    """Count for a while what the processes do in a tick.

    Args:
        pids: of running processes, by side.
        duration_s: [s].
        rate_hz: of their ticks [Hz].

    Raises:
        BenchError: if counting does not end.
    """
    perf = shutil.which("perf")
    if perf is None:
        return KernelCounts({}, "perf is not installed")
    with ExitStack() as stack:
        running = {}
        for side, pid in pids.items():
            options = [word for event in EVENTS for word in ("-e", event)]
            line = [perf, "stat", "-x", ",", *options, "-p", str(pid), "--", "sleep", f"{duration_s:g}"]
            process = subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)  # noqa: S603
            stack.callback(process.kill)
            running[side] = process
        try:
            said = {
                side: process.communicate(timeout=duration_s + COUNT_LIMIT_S)[1] for side, process in running.items()
            }
        except subprocess.TimeoutExpired:
            raise BenchError("perf stat: did not end in time") from None
    ticks = duration_s * rate_hz
    if any(process.returncode for process in running.values()):
        first = next((text.strip().splitlines()[:1] for text in said.values() if text.strip()), [])
        return KernelCounts({}, f"perf stat cannot count: {' '.join(first)}")
    return KernelCounts(
        {
            side: {name: None if found is None else found / ticks for name, found in parse(text.splitlines()).items()}
            for side, text in said.items()
        }
    )


def parse(lines: Iterable[str]) -> Counts:
    """Read the output of `perf stat -x ,`: value, unit and event in the first three columns."""
    found: Counts = {}
    for line in lines:
        columns = line.split(",")
        if len(columns) > 2 and columns[2] in EVENTS:
            value = columns[0]
            found[columns[2]] = float(value) if value.replace(".", "", 1).isdigit() else None
    return found
