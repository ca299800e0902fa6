"""What a process has used so far: CPU time, memory, open descriptors, from the kernel's account of it."""

import os
from pathlib import Path
from typing import NamedTuple

TICKS_PER_S = os.sysconf("SC_CLK_TCK")


class Resources(NamedTuple):
    """At one moment: CPU time of all threads, user and kernel [s]; resident memory [KiB]; open descriptors."""

    cpu_s: float
    rss_kib: int
    descriptors: int


def resources(pid: int) -> Resources:
    """Raises OSError if there is no such process, or it is another user's."""
    folder = Path(f"/proc/{pid}")
    # The second column is the program's name in parentheses and may hold anything; times are the 14th and 15th.
    columns = (folder / "stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
    cpu = (int(columns[11]) + int(columns[12])) / TICKS_PER_S
    resident = resident_kib((folder / "status").read_text(encoding="utf-8"))
    return Resources(cpu, resident, sum(1 for _ in (folder / "fd").iterdir()))


def resident_kib(status: str) -> int:
    """Of the text of /proc/PID/status; 0 for a process that is about to end and has none."""
    for line in status.splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1])
    return 0
