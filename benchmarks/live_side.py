"""One daemon observed from outside: its ticks by its telemetry ring, its resources by the accounts of the kernel.

Nothing here starts a daemon, so that daemons of other releases can be observed too.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.percentiles import Series

TICKS_PER_S = os.sysconf("SC_CLK_TCK")


class Resources(NamedTuple):
    """CPU time of all threads, user and kernel [s]; resident memory [KiB]; open descriptors."""

    cpu_s: float
    rss_kib: int
    descriptors: int


def resources(pid: int) -> Resources:
    """Raises OSError if there is no such process, or it belongs to another user."""
    folder = Path(f"/proc/{pid}")
    # The second column is the name in parentheses, with any characters; times are columns 14 and 15.
    columns = (folder / "stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
    cpu = (int(columns[11]) + int(columns[12])) / TICKS_PER_S
    resident = resident_kib((folder / "status").read_text(encoding="utf-8"))
    return Resources(cpu, resident, sum(1 for _ in (folder / "fd").iterdir()))


def resident_kib(status: str) -> int:
    """Resident memory in the text of /proc/PID/status; 0 for a process that is ending."""
    for line in status.splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1])
    return 0


@dataclass(frozen=True)
class LiveSide:
    """One daemon during the measurement."""

    records: NDArray[np.void]  # of every tick
    rate_hz: float  # of the ticks
    # resources at the beginning, at each read, and at the end, with the time of each [s]
    used: Sequence[tuple[float, Resources]]
    realtime: Mapping[str, Any] = field(default_factory=dict)  # rights that were granted
    faults: Mapping[str, int] = field(default_factory=dict)  # count of each fault, by name

    @property
    def ticks(self) -> int:
        return len(self.records)

    @property
    def missed(self) -> int:
        """Deadlines without a tick."""
        return int(self._gaps.sum())

    @property
    def missed_share(self) -> float:
        return self.missed / (self.ticks + self.missed)

    @property
    def lateness_us(self) -> Series:
        """Lateness of every tick, from the oldest deadline without a tick [us].

        A record counts from the newest passed deadline. cyclictest counts from the one that it waited for, and so does
        this: otherwise a stall of ten periods would look like less than one.
        """
        late: Series = self.records["lateness_us"] + self._gaps * (1e6 / self.rate_hz)
        return late

    @property
    def elapsed_s(self) -> float:
        return self.used[-1][0] - self.used[0][0]

    @property
    def cpu_s(self) -> float:
        return self.used[-1][1].cpu_s - self.used[0][1].cpu_s

    @property
    def _gaps(self) -> Series:
        missed = self.records["ticks_missed"].astype(np.float64)
        return np.diff(missed, prepend=missed[:1])


def memory(sides: Mapping[str, LiveSide]) -> dict[str, Any]:
    """By side: resident memory at the beginning, at the end and at most; growth; descriptors.

    A page is 4 KiB, so one page in a short run looks like fast growth.
    """
    return {name: _memory(side) for name, side in sides.items()}


def _memory(side: LiveSide) -> dict[str, Any]:
    (_, first), (_, last) = side.used[0], side.used[-1]
    return {
        "first_kib": first.rss_kib,
        "last_kib": last.rss_kib,
        "max_kib": max(used.rss_kib for _, used in side.used),
        "growth_kib_per_minute": (last.rss_kib - first.rss_kib) / side.elapsed_s * 60.0,
        "descriptors_first": first.descriptors,
        "descriptors_last": last.descriptors,
    }
