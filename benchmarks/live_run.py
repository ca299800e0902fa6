"""Live run of both daemons, observed through their telemetry rings and the accounts of the kernel."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from signal import SIGTERM
from time import monotonic, sleep
from typing import Any

import numpy as np

from benchmarks.arrangement import Arrangement, BenchError
from benchmarks.live_side import LiveSide, Resources, resources
from weberlink.protocol.states import State
from weberlink.system.configuration import MASTER, SLAVE
from weberlink.system.launcher import Daemon
from weberlink.system.order import DaemonOrder
from weberlink.system.scoring.session import Records
from weberlink.telemetry.ring import default_path

START_LIMIT_S = 60.0
"""Longest time from the start of the daemons to a session."""
SETTLE_S = 1.0
"""Time from a session to the measurement, in which caches, allocator and estimates settle."""
LOOK_S = 0.25
"""Time between two reads: rare, so that reading costs the daemons little; rings hold 10 s."""


def live_run(arrangement: Arrangement, rate_hz: float, duration_s: float) -> dict[str, LiveSide]:
    """Run both daemons and observe them; returns both sides by name.

    Args:
        arrangement: of the run.
        rate_hz: of the ticks [Hz].
        duration_s: of the observation [s].

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
