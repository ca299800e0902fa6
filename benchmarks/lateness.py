"""How late the ticks of both daemons are, between two halves of the limit at the same rate.

The limit has as many threads as there are daemons, their class, priority and processors, and the same machine at
nearly the same time: before the daemons, and after them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks import bare_timer, cyclictest
from benchmarks.arrangement import Arrangement
from benchmarks.live_run import Side, live_run
from benchmarks.percentiles import Series, ratios, summary
from benchmarks.rights import Rights

LIMIT_SHARE = 0.25
"""Of the duration, for each half of the limit."""
DAEMONS = 2


@dataclass(frozen=True)
class Limit:
    """What a process that does nothing else reaches here.

    Args:
        name: of the program, with its version.
        lateness_us: of every wake-up.
    """

    name: str
    lateness_us: Series

    def missed_share(self, rate_hz: float) -> float:
        """Of the deadlines, what it slept through: a wake-up that is late by whole periods has missed as many."""
        missed = float(np.floor(self.lateness_us * rate_hz * 1e-6).sum())
        return missed / (len(self.lateness_us) + missed)


@dataclass(frozen=True)
class Lateness:
    """One rate: both sides, and the limit measured around them."""

    rate_hz: float
    sides: Mapping[str, Side]
    limit: Limit

    @property
    def lateness_us(self) -> Series:
        """Of all ticks of both sides."""
        return np.concatenate([side.lateness_us for side in self.sides.values()])

    @property
    def worst_ratio(self) -> float | None:
        """The p99 of the later daemon, as a multiple of the limit's."""
        limits = summary(self.limit.lateness_us)
        found = [ratios(summary(side.lateness_us), limits)["p99"] for side in self.sides.values()]
        known = [value for value in found if value is not None]
        return max(known) if known else None

    @property
    def missed_share(self) -> float:
        """Of the daemon that missed more."""
        return max(side.missed_share for side in self.sides.values())

    def as_json(self) -> dict[str, Any]:
        limit = summary(self.limit.lateness_us)
        return {
            "rate_hz": self.rate_hz,
            "daemons": {
                name: {
                    "ticks": side.ticks,
                    "missed": side.missed,
                    "missed_share": side.missed_share,
                    "lateness_us": summary(side.lateness_us),
                    "work_us": summary(side.records["work_us"]),
                    "codec_us": summary(side.records["codec_us"]),
                    "ratio": ratios(summary(side.lateness_us), limit),
                    "cpu_share": side.cpu_s / side.elapsed_s,
                    "realtime": side.summary["realtime"],
                    "faults": side.summary["faults"],
                }
                for name, side in self.sides.items()
            },
            "lateness_us": summary(self.lateness_us),
            "limit": {
                "name": self.limit.name,
                "cycles": len(self.limit.lateness_us),
                "missed_share": self.limit.missed_share(self.rate_hz),
                "lateness_us": limit,
            },
            "ratio": ratios(summary(self.lateness_us), limit),
        }


def measure(arrangement: Arrangement, rate_hz: float, rights: Rights) -> Lateness:
    """Half of the limit, the daemons, the other half.

    Raises:
        BenchError: if a program cannot be run to its end.
    """
    half_s = LIMIT_SHARE * arrangement.duration_s
    before = limit(rate_hz, half_s, rights)
    sides = live_run(arrangement, rate_hz, arrangement.duration_s)
    after = limit(rate_hz, half_s, rights)
    return Lateness(rate_hz, sides, Limit(after.name, np.concatenate([before.lateness_us, after.lateness_us])))


def limit(rate_hz: float, duration_s: float, rights: Rights) -> Limit:
    """cyclictest where it is installed, else a process in Python that waits for a timer."""
    name = cyclictest.version()
    if name is None:
        return Limit(bare_timer.NAME, bare_timer.measure(rate_hz, duration_s, rights, DAEMONS))
    line = cyclictest.arguments(rate_hz, duration_s, rights, threads=DAEMONS)
    return Limit(name, cyclictest.measure(line, duration_s).latencies_us)
