"""One live run: both daemons as the launcher starts them, watched from outside through their rings and by the kernel.

Owns the start, the stretch that counts, and the orderly end. What the rings and the kernel said is kept whole.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from signal import SIGTERM
from time import monotonic, sleep
from typing import Any

import numpy as np

from benchmarks.arrangement import Arrangement, BenchError
from benchmarks.percentiles import Series
from benchmarks.resources import Resources, resources
from weberlink.protocol.states import State
from weberlink.system.configuration import MASTER, SLAVE
from weberlink.system.daemon import DaemonOrder
from weberlink.system.launcher import Daemon
from weberlink.system.scoring.session import Records
from weberlink.telemetry.ring import default_path

START_LIMIT_S = 60.0
"""From the start of the daemons to a session."""
SETTLE_S = 1.0
"""From a session to the stretch that counts: caches, allocator and estimates have come to rest."""
LOOK_S = 0.25
"""Between two looks: rare, so that looking costs the daemons little; rings hold 10 s."""


@dataclass(frozen=True)
class Side:
    """One daemon over the stretch that counts.

    Args:
        records: of every tick.
        rate_hz: of the ticks.
        used: what the kernel booked at the beginning, at each look, and at the end, with the time of each [s].
        summary: what it said at its end.
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
        """Of every tick, from the oldest deadline that had no tick yet [us].

        A record counts from the newest deadline that has passed. cyclictest counts from the one it waited for, and
        so does this: else a stall of ten periods would look like less than one.
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


def live_run(arrangement: Arrangement, rate_hz: float, duration_s: float) -> dict[str, Side]:
    """Run both daemons; returns what was seen of each over the duration [s].

    Raises:
        BenchError: if a daemon ends by itself, or they do not find each other.
        ConfigurationError: if the file or an override is wrong.
    """
    overrides = arrangement.overrides(rate_hz)
    arrangement.configuration(overrides)
    with _daemons(arrangement.file, overrides) as daemons:
        _engage(daemons)
        sleep(SETTLE_S)
        for daemon in daemons.values():
            daemon.records()  # of the start, which does not count
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
    return {side: Side(np.concatenate(records[side]), rate_hz, used[side], summaries[side]) for side in sorted(daemons)}


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
    """Wait until both are in a session."""
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
