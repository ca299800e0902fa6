"""What a launcher asks of a daemon, and what it hears of its end."""

from collections.abc import Sequence
from dataclasses import dataclass
from signal import SIGHUP, SIGINT, SIGTERM
from typing import Any

from weberlink.child_process import Order

COMPLETED, FAILED, MISCONFIGURED = 0, 1, 2
INTERRUPTED = 130
"""Exit statuses of every command; the last one where Ctrl-C ends work that has an end of its own."""

EMERGENCY = "emergency stop"
"""Outcome of a run that somebody ended in this way."""

NOTE = "note: "
"""How a line of advice on standard error begins."""

MASTER, SLAVE = "master", "slave"
SIDES = (MASTER, SLAVE)
STOP_SIGNALS = (SIGINT, SIGTERM, SIGHUP)


@dataclass(frozen=True)
class DaemonOrder(Order):
    """What a daemon runs.

    Args:
        side: one of `SIDES`.
        file: the configuration.
        overrides: as of `--set`.
        ring: where to write telemetry.
        duration_s: length of the run; None to run until it is stopped.
        take_over: whether a master replaces another one that the slave serves.
    """

    side: str
    file: str
    overrides: tuple[str, ...]
    ring: str
    duration_s: float | None = None
    take_over: bool = False


def failure(outcome: str, trace: Sequence[str] = ()) -> dict[str, Any]:
    """The summary of a daemon without a first tick, or one that could not report its end; `trace` of what it raised."""
    return {
        "outcome": outcome,
        "trace": list(trace),
        "failed": True,
        "faults": {},
        "drops": {},
        "peer": None,
        "paths": [],
        "realtime": None,
    }
