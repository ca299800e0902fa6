"""Figures by source: geometric means over the recordings of a source, then over sources, which are not pooled.

Recordings of one source are alike, and sources have very different numbers of them: a mean over all recordings would be
that of the largest source.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from math import exp, log
from statistics import fmean
from typing import Any

from weberlink.codec.predictors import HYBRID
from weberlink.studies.evaluate.study import EvaluationRow

SINGLES = ("zoh", "linear", "plane", "sphere")
"""Predictors of the paper; the best of them on a recording is a reference."""
MOST = 1.05
"""Packets over those of the best single predictor above which a recording counts as a loss."""
MORE_PER_S = 1.0
"""And so many packets per second more: with few packets, one more is a large share."""
EVERY = "sources"
"""Name of the geometric mean over sources."""


@dataclass(frozen=True)
class SourceFigures:
    """One predictor, Weber factor and deadband on the recordings of one source; ratios are of packets.

    Args:
        source: or `EVERY`.
        recordings: number of them.
        packets_per_s: geometric mean; so are `bytes_per_s` and the ratios.
        over_hybrid: None without rows of the hybrid.
        over_best: over the best of `SINGLES` on each recording; None without rows of all of them.
        above: share of recordings with more than `MOST` of the best.
        above_by: share of those that also send more than `MORE_PER_S` more.
        error_rms_jnd: mean.
    """

    source: str
    predictor: str
    weber: float
    deadband: str
    recordings: int
    packets_per_s: float
    bytes_per_s: float
    over_hybrid: float | None
    over_best: float | None
    above: float | None
    above_by: float | None
    error_rms_jnd: float

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def by_source(rows: Iterable[EvaluationRow]) -> list[SourceFigures]:
    """Figures of each source, then those over all sources if there are several, for every combination of the rest."""
    groups: dict[tuple[str, str, float], dict[str, list[EvaluationRow]]] = {}
    rates: dict[tuple[str, str, str, float], float] = {}
    for row in rows:
        groups.setdefault((row.deadband, row.predictor, row.weber), {}).setdefault(row.source, []).append(row)
        rates[row.trace, row.deadband, row.predictor, row.weber] = _rate(row)
    found: list[SourceFigures] = []
    for sources in groups.values():
        each = [_figures(source, mine, rates) for source, mine in sources.items()]
        found += [*each, _over_sources(each)] if len(each) > 1 else each
    order = [*dict.fromkeys(one.source for one in found if one.source != EVERY), EVERY]
    return sorted(found, key=lambda one: order.index(one.source))


def loses(per_s: float, best_per_s: float) -> bool:
    """Whether a rate is more than `MOST` of the best, and more than `MORE_PER_S` above it."""
    return per_s > max(MOST * best_per_s, best_per_s + MORE_PER_S)


def geometric_mean(values: Iterable[float]) -> float:
    return exp(fmean(map(log, values)))


def _rate(row: EvaluationRow) -> float:
    """Packets per second; at least one packet, which a ratio needs."""
    return max(row.packets, 1) / row.duration_s


def _figures(
    source: str, rows: Sequence[EvaluationRow], rates: dict[tuple[str, str, str, float], float]
) -> SourceFigures:
    first = rows[0]
    own = [_rate(row) for row in rows]

    def of(predictor: str) -> Iterator[float | None]:
        return (rates.get((row.trace, row.deadband, predictor, row.weber)) for row in rows)

    hybrid = [rate for rate in of(HYBRID) if rate is not None]
    singles = [[rate for rate in each if rate is not None] for each in zip(*map(of, SINGLES), strict=True)]
    best = [min(each) for each in singles if len(each) == len(SINGLES)]
    compared = list(zip(own, best, strict=True)) if len(best) == len(own) else []
    return SourceFigures(
        source,
        first.predictor,
        first.weber,
        first.deadband,
        len(rows),
        geometric_mean(own),
        geometric_mean(max(row.bytes_per_s, 1.0 / row.duration_s) for row in rows),
        geometric_mean(rate / other for rate, other in zip(own, hybrid, strict=True))
        if len(hybrid) == len(own)
        else None,
        geometric_mean(rate / other for rate, other in compared) if compared else None,
        fmean(rate > MOST * other for rate, other in compared) if compared else None,
        fmean(loses(rate, other) for rate, other in compared) if compared else None,
        fmean(row.error_rms_jnd for row in rows),
    )


def _over_sources(each: Sequence[SourceFigures]) -> SourceFigures:
    def ratio(name: str) -> float | None:
        values = [value for one in each if (value := getattr(one, name)) is not None]
        return geometric_mean(values) if len(values) == len(each) else None

    def share(name: str) -> float | None:
        values = [value for one in each if (value := getattr(one, name)) is not None]
        return fmean(values) if len(values) == len(each) else None

    first = each[0]
    return SourceFigures(
        EVERY,
        first.predictor,
        first.weber,
        first.deadband,
        sum(one.recordings for one in each),
        geometric_mean(one.packets_per_s for one in each),
        geometric_mean(one.bytes_per_s for one in each),
        ratio("over_hybrid"),
        ratio("over_best"),
        share("above"),
        share("above_by"),
        fmean(one.error_rms_jnd for one in each),
    )
