"""What the host of a virtual machine takes from it: wake-ups that come late on a processor, and steal time.

Run as a program, this file watches processors for the launcher of a session: a process on each sleeps to absolute
deadlines, before the daemons in priority, and writes a line for each wake-up that came late. The daemons could not have
been on time then either. It locks no memory: pages used every few milliseconds are not swapped out.
"""

import json
import os
import sys
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass
from math import inf
from pathlib import Path
from signal import SIG_DFL, SIGKILL, SIGTERM, signal
from time import monotonic, sleep
from typing import NamedTuple, Self

from weberlink.child_process import Order
from weberlink.realtime.process import die_with_parent, prepare

STATISTICS = Path("/proc/stat")
BUSY_COLUMNS = 8  # columns of /proc/stat up to steal; those after it are parts of earlier ones (proc_stat(5))


class WakeUp(NamedTuple):
    """A wake-up of a watcher: times on the clock of `time.monotonic` [s]."""

    ran: float  # when the watcher ran before
    due: float
    woken: float  # when it ran again

    @property
    def late(self) -> float:
        return self.woken - self.due


def wake_ups(first: float, interval: float, until: float = inf) -> Iterator[WakeUp]:
    """Sleep to deadlines `interval` apart [s], from `first` on; those that have passed meanwhile are left out."""
    ran, due = monotonic(), first
    while due < until:
        if due > ran:
            sleep(max(0.0, due - monotonic()))
            woken = monotonic()
            yield WakeUp(ran, due, woken)
            ran = woken
        due += interval * max(1.0, (ran - due) // interval + 1.0)


class Steal(NamedTuple):
    """Time of some processors since boot [ticks of the kernel's statistics]."""

    stolen: int
    total: int

    @classmethod
    def read(cls, processors: Collection[int], path: Path = STATISTICS) -> Self | None:
        """The present times; None if the kernel does not count steal time, or has never seen any.

        A machine that is not virtual, and a host that does not tell, both give zeros since boot."""
        try:
            lines = path.read_text(encoding="ascii").splitlines()
        except (OSError, UnicodeDecodeError):
            return None
        names = {f"cpu{number}" for number in processors}
        stolen = total = ever = 0
        for name, *words in (line.split() for line in lines if line.startswith("cpu")):
            if len(words) < BUSY_COLUMNS or not all(word.isdigit() for word in words):
                return None
            columns = [int(word) for word in words[:BUSY_COLUMNS]]
            ever += columns[-1]
            if name in names:
                stolen, total = stolen + columns[-1], total + sum(columns)
        return cls(stolen, total) if ever else None

    def share_since(self, before: "Steal") -> float | None:
        """Share of the processors' time that the host took since an earlier reading; None if no time has passed."""
        passed = self.total - before.total
        return max(0, self.stolen - before.stolen) / passed if passed > 0 else None


@dataclass(frozen=True)
class WatchOrder(Order):
    """What the program watches; times in s, on the clock of `time.monotonic`."""

    processors: tuple[int, ...]  # numbers of those that it may run on
    priority: int  # above that of the daemons: one that does not end its tick must not look like the host
    first: float  # a deadline
    interval: float  # between deadlines
    least: float  # lateness from which a wake-up is written


def main(text: str) -> int:
    """The program: writes one line on its scheduling class, then `processor ran due woken` for each late wake-up.

    Ends when it is told to, or when one of its watchers has ended."""
    order = WatchOrder.from_json(text)
    signal(SIGTERM, lambda *_: sys.exit())
    die_with_parent(SIGTERM, order.parent)
    grant = prepare(order.priority, lock_memory=False, cpu=None).priority
    _write(json.dumps({"granted": grant.granted, "detail": grant.detail}))
    if not grant:
        return 1
    os.set_blocking(sys.stdout.fileno(), False)
    # Threads would wait for each other's turn in the interpreter: that doubles the cost of a wake-up.
    watchers = [_fork(order, processor) for processor in order.processors]
    try:
        os.wait()
    finally:
        for watcher in watchers:
            with suppress(ProcessLookupError, ChildProcessError):
                os.kill(watcher, SIGKILL)
                os.waitpid(watcher, 0)
    return 1


def _fork(order: WatchOrder, processor: int) -> int:
    """Start a watcher of one processor; returns its process id."""
    own = os.getpid()
    watcher = os.fork()
    if watcher == 0:
        try:
            signal(SIGTERM, SIG_DFL)
            die_with_parent(SIGKILL, own)
            os.sched_setaffinity(0, {processor})
            for wake_up in wake_ups(order.first, order.interval):
                if wake_up.late >= order.least:
                    with suppress(BlockingIOError):  # a launcher that does not read loses lines, and delays nothing
                        _write(f"{processor} {wake_up.ran:.6f} {wake_up.due:.6f} {wake_up.woken:.6f}")
        finally:
            os._exit(1)
    return watcher


def _write(line: str) -> None:
    os.write(sys.stdout.fileno(), f"{line}\n".encode())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
