"""How long an update is under way, between processes on this host, beside plain sockets and beside sockperf.

All three in turn, the limits before and after: the same number of bytes, the same rights, one question at a time.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks import echo, sockperf
from benchmarks.arrangement import MAIN_RATE_HZ, Arrangement
from benchmarks.bare_echo import SIZE
from benchmarks.echo import Trips
from benchmarks.percentiles import Series, Summary, ratios, summary
from benchmarks.rights import Rights

WAYS = ("position", "force", "round_trip")
"""Master to slave, slave to master, and both."""
CODED_SHARE, LIMIT_SHARE = 0.25, 0.125
"""Of the duration: of the coded echo, and of each half of each limit."""


@dataclass(frozen=True)
class Latency:
    """The ways of updates, of the same bytes through plain sockets, and of sockperf's if it is installed."""

    coded: Trips
    plain: Trips
    sockperf: Series | None
    sockperf_version: str | None

    @property
    def worst_ratio(self) -> float | None:
        """The median of the slower way as a multiple of a plain socket's."""
        ratios_ = self.as_json()["ratio_to_plain"]
        known = [ratios_[way]["p50"] for way in ("position", "force") if ratios_[way]["p50"] is not None]
        return max(known) if known else None

    def as_json(self) -> dict[str, Any]:
        coded, plain = _summaries(self.coded), _summaries(self.plain)
        fast = None if self.sockperf is None else summary(self.sockperf)
        return {
            "rate_hz": MAIN_RATE_HZ,
            "size_bytes": SIZE,
            "updates": len(self.coded.round_us),
            "weberlink_us": coded,
            "plain_socket_us": plain,
            "sockperf": None
            if fast is None or self.sockperf is None
            else {"version": self.sockperf_version, "questions": len(self.sockperf), "round_trip_us": fast},
            "ratio_to_plain": {way: ratios(coded[way], plain[way]) for way in WAYS},
            "ratio_to_sockperf": None if fast is None else {"round_trip": ratios(coded["round_trip"], fast)},
        }


def measure(arrangement: Arrangement, rights: Rights) -> Latency:
    """The limits, the updates, the limits.

    Raises:
        BenchError: if a program cannot be run to its end.
    """
    version = sockperf.version()
    half_s = LIMIT_SHARE * arrangement.duration_s
    order = {"file": str(arrangement.file), "overrides": arrangement.overrides(MAIN_RATE_HZ)}
    fast, plain = [], []
    for turn in range(2):
        if version is not None:
            fast.append(sockperf.measure(SIZE, half_s, rights))
        plain.append(echo.measure("bare_echo", {}, MAIN_RATE_HZ, half_s, rights))
        if turn == 0:
            coded = echo.measure("coded_echo", order, MAIN_RATE_HZ, CODED_SHARE * arrangement.duration_s, rights)
    return Latency(coded, _joined(plain), np.concatenate(fast) if fast else None, version)


def _joined(parts: list[Trips]) -> Trips:
    there, back, both = (
        np.concatenate(each) for each in zip(*((p.there_us, p.back_us, p.round_us) for p in parts), strict=True)
    )
    return Trips(there, back, both)


def _summaries(trips: Trips) -> Mapping[str, Summary]:
    ways = (trips.there_us, trips.back_us, trips.round_us)
    return {way: summary(values) for way, values in zip(WAYS, ways, strict=True)}
