"""The figures of one side between two summaries, from its records alone, in bounded memory."""

from dataclasses import dataclass, field
from math import isfinite
from typing import Any

from weberlink.protocol.states import State
from weberlink.system.journal.changes import Fields, Records
from weberlink.system.scoring.distribution import Distribution

COUNTERS = ("updates_sent", "datagrams_sent", "datagrams_received", "datagrams_lost", "datagrams_dropped", "bytes_sent")


@dataclass
class Interval:
    """What a summary is made of.

    Args:
        first: the record before the interval, or its first.
        since_s: when it began, on the clock of the records.
    """

    first: Any
    since_s: float
    engaged: int = 0
    ticks: int = 0
    lateness: Distribution = field(default_factory=Distribution)
    rtt: Distribution = field(default_factory=Distribution)

    def add(self, records: Records) -> None:
        self.ticks += len(records)
        self.engaged += int((records["state"] == State.ENGAGED.value).sum())
        self.lateness.add(records["lateness_us"])
        self.rtt.add(records["rtt_us"])

    def figures(self, last: Any) -> Fields:
        duration = float(last["at"]) - self.since_s
        counts = {name: int(last[name]) - int(self.first[name]) for name in COUNTERS}
        return {
            "interval_s": round(duration, 3),
            "packets_per_s": _per_second(counts["updates_sent"], duration),
            "reduction": round(1.0 - counts["updates_sent"] / self.engaged, 6) if self.engaged else None,
            "bytes_per_s": _per_second(counts["bytes_sent"], duration),
            "lateness_us": _known(self.lateness, "p50", "p99", "max"),
            "rtt_us": _known(self.rtt, "p50", "p99"),
            "ticks": self.ticks,
            "missed": int(last["ticks_missed"]) - int(self.first["ticks_missed"]),
            "sent": counts["datagrams_sent"],
            "received": counts["datagrams_received"],
            "lost": counts["datagrams_lost"],
            "dropped": counts["datagrams_dropped"],
        }


def _known(distribution: Distribution, *names: str) -> dict[str, float | None]:
    figures = distribution.summary()
    return {name: round(figures[name], 1) if isfinite(figures[name]) else None for name in names}


def _per_second(count: int, duration: float) -> float | None:
    return round(count / duration, 2) if duration > 0.0 else None
