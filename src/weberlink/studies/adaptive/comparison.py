"""Ratios of packets by group and source: geometric means with intervals over recordings, worst cases, losses."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import log
from statistics import fmean, median

import numpy as np

from weberlink.codec.predictors import ADAPTIVE, HYBRID
from weberlink.studies.adaptive.coding import SINGLES, RateRow
from weberlink.studies.curves import CONFIDENCE, RESAMPLES, Band
from weberlink.studies.evaluate.by_source import MOST, loses

SEED = 1
"""Of the bootstrap."""
LEAST = 1e-6
"""Smallest RMS error whose ratio is taken [JND]."""


@dataclass(frozen=True)
class SignalRatios:
    """`adaptive` on one signal at one rate; packets of 0 count as 1.

    Args:
        per_s: packets per second of `adaptive`; `hybrid_per_s` and `best_per_s` of the others.
        best: the best single predictor of the paper on this signal.
        bytes_over_hybrid: ratio of the payloads.
        error_over_hybrid: ratio of the RMS errors in JND.
    """

    signal: str
    group: str
    source: str
    kind: str
    rate_hz: int
    per_s: float
    hybrid_per_s: float
    best_per_s: float
    best: str
    bytes_over_hybrid: float
    error_over_hybrid: float

    @property
    def over_hybrid(self) -> float:
        return self.per_s / self.hybrid_per_s

    @property
    def over_best(self) -> float:
        return self.per_s / self.best_per_s

    @property
    def lost(self) -> bool:
        return loses(self.per_s, self.best_per_s)


@dataclass(frozen=True)
class GroupFigures:
    """`adaptive` on the signals of one group at one rate.

    Args:
        name: of the group.
        rate_hz: of the ticks.
        signals: number of them.
        per_s: geometric mean of the packets per second.
        over_hybrid: geometric mean of the ratios with its 95 % interval over signals; so is `over_best`.
        bytes_over_hybrid: geometric mean; so is `error_over_hybrid`.
        worst: largest ratio to the best single predictor, and the signal.
        above: share of signals above 1.05 of the best.
        lost: share of those that also send more than 1 packet per second more.
    """

    name: str
    rate_hz: int
    signals: int
    per_s: float
    over_hybrid: Band
    over_best: Band
    bytes_over_hybrid: float
    error_over_hybrid: float
    worst: tuple[float, str]
    above: float
    lost: float


def ratios(rows: Iterable[RateRow]) -> list[SignalRatios]:
    """One for each signal and rate."""
    table: dict[tuple[str, int], dict[str, RateRow]] = {}
    for row in rows:
        table.setdefault((row.signal, row.rate_hz), {})[row.predictor] = row
    return [_ratios_of(each) for each in table.values()]


def _ratios_of(each: dict[str, RateRow]) -> SignalRatios:
    def per_s(name: str) -> float:
        return max(each[name].packets, 1) / each[name].duration_s

    ours, hybrid = each[ADAPTIVE], each[HYBRID]
    best = min(SINGLES, key=per_s)
    return SignalRatios(
        ours.signal, ours.group, ours.source, ours.kind, ours.rate_hz,
        per_s(ADAPTIVE), per_s(HYBRID), per_s(best), best,
        max(ours.bytes, 1) / max(hybrid.bytes, 1), max(ours.error_rms_jnd, LEAST) / max(hybrid.error_rms_jnd, LEAST),
    )  # fmt: skip


def by_group(found: Iterable[SignalRatios]) -> list[GroupFigures]:
    """Figures of every group at every rate, in the order of their first signals."""
    groups: dict[tuple[int, str], list[SignalRatios]] = {}
    for one in found:
        groups.setdefault((one.rate_hz, one.group), []).append(one)
    return [_figures(name, rate, [mine]) for (rate, name), mine in groups.items()]


def over_sources(found: Iterable[SignalRatios], name: str, rate_hz: int, sources: Sequence[str]) -> GroupFigures | None:
    """Figures of several sources, each of which counts once; None without signals of any of them."""
    listed = [one for one in found if one.rate_hz == rate_hz]
    each = [mine for source in sources if (mine := [one for one in listed if one.source == source])]
    return _figures(name, rate_hz, each) if each else None


def _figures(name: str, rate_hz: int, sources: Sequence[Sequence[SignalRatios]]) -> GroupFigures:
    everything = [one for mine in sources for one in mine]

    def mean(of: Callable[[SignalRatios], float]) -> float:
        return float(np.exp(fmean(fmean(log(of(one)) for one in mine) for mine in sources)))

    def share(of: Callable[[SignalRatios], bool]) -> float:
        return fmean(fmean(of(one) for one in mine) for mine in sources)

    worst = max(everything, key=lambda one: one.over_best)
    return GroupFigures(
        name,
        rate_hz,
        len(everything),
        mean(lambda one: one.per_s),
        interval([[one.over_hybrid for one in mine] for mine in sources]),
        interval([[one.over_best for one in mine] for mine in sources]),
        mean(lambda one: one.bytes_over_hybrid),
        mean(lambda one: one.error_over_hybrid),
        (worst.over_best, worst.signal),
        share(lambda one: one.over_best > MOST),
        share(lambda one: one.lost),
    )


def interval(sources: Sequence[Sequence[float]]) -> Band:
    """Geometric mean over the ratios of each source, then over sources, and its 95 % bootstrap interval.

    The recordings of every source are drawn anew; the sources are not, because they are all there is to report.
    """
    random = np.random.default_rng(SEED)
    means, drawn = [], np.zeros(RESAMPLES)
    for values in sources:
        logs = np.log(values)
        means.append(logs.mean())
        drawn += logs[random.integers(len(logs), size=(RESAMPLES, len(logs)))].mean(axis=1) / len(sources)
    mean = float(np.mean(means))
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(drawn, [tail, 100.0 - tail])
    return Band(*(float(value) for value in np.exp([mean, min(low, mean), max(high, mean)])))


def run_times(rows: Iterable[RateRow], rate_hz: int) -> dict[str, float]:
    """Median over the signals of the median run time of a tick [us], by predictor."""
    found: dict[str, list[float]] = {}
    for row in rows:
        if row.rate_hz == rate_hz:
            found.setdefault(row.predictor, []).append(row.tick_us)
    return {name: median(values) for name, values in found.items()}
