"""Lateness of the ticks of both daemons, between two halves of the limit at the same rate.

The limit has as many threads as there are daemons, with their class, priority and processors. It is cyclictest or,
where that is not installed, Python processes that wait for a timer; this module is such a process.
"""

import gc
import os
import sys
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from time import monotonic_ns
from typing import Any

import numpy as np

from benchmarks import programs
from benchmarks.arrangement import Arrangement, Rights, answers, child, rights_of, serve
from benchmarks.live_side import LiveSide
from benchmarks.loopback import live_run
from benchmarks.percentiles import Series, ratios, summary
from weberlink.realtime import timerfd

LIMIT_SHARE = 0.25  # share of the duration for each half of the limit
DAEMONS = 2
BARE_TIMER = "timerfd in Python"
PATIENCE_S = 30.0


@dataclass(frozen=True)
class LatenessLimit:
    """Lateness of threads that only wait for a timer."""

    name: str  # of the program, with its version
    lateness_us: Series  # of every wake-up

    def missed_share(self, rate_hz: float) -> float:
        """Share of missed deadlines: a wake-up that is late by whole periods has missed as many."""
        missed = float(np.floor(self.lateness_us * rate_hz * 1e-6).sum())
        return missed / (len(self.lateness_us) + missed)


@dataclass(frozen=True)
class Lateness:
    """Both sides at one rate, and the limit measured before and after them."""

    rate_hz: float
    sides: Mapping[str, LiveSide]
    limit: LatenessLimit

    @property
    def lateness_us(self) -> Series:
        """Lateness of all ticks of both sides."""
        return np.concatenate([side.lateness_us for side in self.sides.values()])

    @property
    def worst_ratio(self) -> float | None:
        """99th percentile of the later daemon over that of the limit."""
        limits = summary(self.limit.lateness_us)
        found = [ratios(summary(side.lateness_us), limits)["p99"] for side in self.sides.values()]
        known = [value for value in found if value is not None]
        return max(known) if known else None

    @property
    def missed_share(self) -> float:
        """Share of the daemon that missed more."""
        return max(side.missed_share for side in self.sides.values())

    @property
    def cpu_share(self) -> float:
        """Share of a core of the daemon that uses more."""
        return max(side.cpu_s / side.elapsed_s for side in self.sides.values())

    @property
    def work_p50_us(self) -> float:
        """Median work of a tick of the side that works more [us]."""
        return max(summary(side.records["work_us"])["p50"] or 0.0 for side in self.sides.values())

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
                    "realtime": dict(side.realtime),
                    "faults": dict(side.faults),
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
    """Measure half of the limit, the daemons, and the other half."""
    half_s = LIMIT_SHARE * arrangement.duration_s
    before = limit(rate_hz, half_s, rights)
    sides = live_run(arrangement, rate_hz, arrangement.duration_s)
    after = limit(rate_hz, half_s, rights)
    return Lateness(rate_hz, sides, LatenessLimit(after.name, np.concatenate([before.lateness_us, after.lateness_us])))


def limit(rate_hz: float, duration_s: float, rights: Rights) -> LatenessLimit:
    """Measure cyclictest or, where it is not installed, a process that waits for a timer."""
    name = programs.cyclictest_version()
    if name is None:
        return LatenessLimit(BARE_TIMER, bare_timer(rate_hz, duration_s, rights, DAEMONS))
    line = programs.cyclictest_line(rate_hz, duration_s, rights, threads=DAEMONS)
    return LatenessLimit(name, programs.cyclictest(line, duration_s).latencies_us)


def bare_timer(rate_hz: float, duration_s: float, rights: Rights, processes: int) -> Series:
    """Lateness of all wake-ups of some waiting processes [us]."""
    with ExitStack() as stack:
        orders = [{"rate_hz": rate_hz, "duration_s": duration_s, "place": place} for place in range(processes)]
        running = [stack.enter_context(child("lateness", order, rights)) for order in orders]
        seen = answers(running, 2.0 * duration_s + PATIENCE_S, "the bare timer")
    return np.concatenate([np.array(each, dtype=np.float64) for each in seen])


def waits(rate_hz: float, count: int) -> list[float]:
    """Wait for `count` deadlines; how late each wake-up was, from the oldest deadline that had passed [us]."""
    period = round(1e9 / rate_hz)
    fd = timerfd.create()
    try:
        os.set_blocking(fd, True)
        start = monotonic_ns() + period
        timerfd.arm(fd, start, period)
        lateness, passed = [], 0
        while passed < count:
            expired = timerfd.expirations(fd)
            lateness.append((monotonic_ns() - (start + passed * period)) * 1e-3)
            passed += expired
    finally:
        os.close(fd)
    return lateness


def _bare(order: Mapping[str, Any]) -> list[float]:
    rights_of(order).take(order["place"])
    gc.disable()
    return waits(order["rate_hz"], max(1, round(order["rate_hz"] * order["duration_s"])))


if __name__ == "__main__":
    sys.exit(serve(_bare))
