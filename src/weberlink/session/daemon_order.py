"""What a launcher asks of a daemon, and what it hears of its end."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from weberlink.child_process import Order


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
