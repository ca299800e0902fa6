"""Live run of both daemons, observed through their telemetry rings and the accounts of the kernel."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from signal import SIGTERM
from time import monotonic, sleep
from typing import Any, NamedTuple

import numpy as np

from benchmarks.arrangement import Arrangement, BenchError
from benchmarks.percentiles import Series
from weberlink.protocol.states import State
from weberlink.system.configuration import MASTER, SLAVE
from weberlink.system.launcher import Daemon
from weberlink.system.order import DaemonOrder
from weberlink.system.scoring.session import Records
from weberlink.telemetry.ring import default_path

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


START_LIMIT_S = 60.0
"""Longest time from the start of the daemons to a session."""
SETTLE_S = 1.0
"""Time from a session to the measurement, in which caches, allocator and estimates settle."""
LOOK_S = 0.25
"""Time between two reads: rare, so that reading costs the daemons little; rings hold 10 s."""


@dataclass(frozen=True)
class LiveSide:
    """One daemon during the measurement.

    Args:
        records: of every tick.
        rate_hz: of the ticks.
        used: resources at the beginning, at each read, and at the end, with the time of each [s].
        summary: of the daemon at its end.
    """

    records: Records
    rate_hz: float
    used: Sequence[tuple[float, Resources]]
    summary: Mapping[str, Any]

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


def live_run(arrangement: Arrangement, rate_hz: float, duration_s: float) -> dict[str, LiveSide]:
    """Run both daemons for a duration [s]; returns both sides by name.

    Raises:
        BenchError: if a daemon ends by itself, or they do not connect.
        ConfigurationError: if the file or an override is wrong.
    """
    overrides = arrangement.overrides(rate_hz)
    arrangement.configuration(overrides)
    with _daemons(arrangement.file, overrides) as daemons:
        _engage(daemons)
        sleep(SETTLE_S)
        for daemon in daemons.values():
            daemon.records()  # the start does not count
        records: dict[str, list[Records]] = {side: [] for side in daemons}
        used: dict[str, list[tuple[float, Resources]]] = {side: [] for side in daemons}
        until = monotonic() + duration_s
        while True:
            for side, daemon in daemons.items():
                used[side].append((monotonic(), _resources(daemon)))
                records[side].append(daemon.records())
            left = until - monotonic()
            if left <= 0.0:
                break
            sleep(min(LOOK_S, left))
        summaries = {side: _end(daemon) for side, daemon in sorted(daemons.items())}  # the master first
    return {
        side: LiveSide(np.concatenate(records[side]), rate_hz, used[side], summaries[side]) for side in sorted(daemons)
    }


@contextmanager
def _daemons(file: Path, overrides: Sequence[str]) -> Iterator[dict[str, Daemon]]:
    daemons: dict[str, Daemon] = {}
    try:
        for side in (SLAVE, MASTER):  # the slave first: it listens when the master calls
            ring = default_path(f"{os.getpid()}-{side}")
            ring.unlink(missing_ok=True)  # of an earlier process that had our number
            daemons[side] = Daemon(DaemonOrder(side, str(file), tuple(overrides), str(ring), os.getpid()))
        yield daemons
    finally:
        for daemon in daemons.values():
            if daemon.running:
                daemon.stop(SIGTERM)
                daemon.finish()
            daemon.release()


def _engage(daemons: Mapping[str, Daemon]) -> None:
    """Wait until both are engaged."""
    until = monotonic() + START_LIMIT_S
    waiting = set(daemons)
    while waiting:
        for side in sorted(waiting):
            daemon = daemons[side]
            if not daemon.running:
                raise BenchError(f"the {side} ended before the session began: {daemon.finish()['outcome']}")
            records = daemon.records()
            if len(records) and records["state"][-1] == State.ENGAGED.value:
                waiting.discard(side)
        if monotonic() > until:
            raise BenchError(f"no session in {START_LIMIT_S:g} s")
        sleep(0.05)


def _resources(daemon: Daemon) -> Resources:
    try:
        return resources(daemon.pid)
    except OSError:
        raise BenchError(f"the {daemon.side} ended during the measurement: {daemon.finish()['outcome']}") from None


def _end(daemon: Daemon) -> dict[str, Any]:
    daemon.stop(SIGTERM)
    summary = daemon.finish()
    if summary["failed"]:
        raise BenchError(f"the {daemon.side} failed: {summary['outcome']}")
    return summary


def memory(sides: Mapping[str, LiveSide]) -> dict[str, Any]:
    """By side: resident memory at the beginning, at the end and at most; growth; descriptors; garbage collections.

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
        "garbage": side.summary.get("garbage"),
    }
