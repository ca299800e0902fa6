"""Detect stalls of the host: times in which it gives this machine no processor time.

A process on each processor sleeps for 5 ms again and again, at a higher priority than the daemons. If it wakes up late,
the daemons could not have been on time either.
"""

import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from tempfile import NamedTemporaryFile
from time import clock_gettime, clock_gettime_ns, sleep

SLEEP_S = 0.005
STALL_S = 0.02
"""Shortest stall that excuses a live session [s]: the shortest pause that a daemon counts as a stall."""
PRIORITY = 60
"""SCHED_FIFO priority, above that of a daemon; the normal scheduler, as for the daemons, if it is not permitted."""
CLOCK = 7
"""CLOCK_BOOTTIME of Linux, which also counts the time for which a virtual machine was suspended."""


class HostStalls:
    """Watches from construction until `end`."""

    def __init__(self) -> None:
        self._times = NamedTemporaryFile("r")  # noqa: SIM115 - closed at the end
        self._watchers = [
            subprocess.Popen([sys.executable, "-S", __file__, self._times.name, str(processor), str(os.getpid())])
            for processor in sorted(os.sched_getaffinity(0))
        ]

    def end(self) -> None:
        for watcher in self._watchers:
            watcher.kill()
            watcher.wait()
        self._times.close()

    def has_stalled(self, since: float) -> bool:
        """Whether a stall of at least `STALL_S` has ended since a time of `now` [s]."""
        sleep(2.0 * SLEEP_S)  # a stall that has just ended is being written
        self._times.seek(0)
        return any(float(line) >= since for line in self._times)


def now() -> float:
    """Time on the clock of the stalls [s]."""
    return clock_gettime(CLOCK)


def watch(path: Path, processor: int, parent: int) -> None:
    """Append the end [s] of each stall to a file, until the parent is gone."""
    os.sched_setaffinity(0, {processor})
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    descriptor = os.open(path, os.O_WRONLY | os.O_APPEND)
    before = clock_gettime_ns(CLOCK)
    while os.getppid() == parent:
        sleep(SLEEP_S)
        woken = clock_gettime_ns(CLOCK)
        late, before = 1e-9 * (woken - before) - SLEEP_S, woken
        if late >= STALL_S:
            os.write(descriptor, f"{1e-9 * woken}\n".encode())


if __name__ == "__main__":
    watch(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
