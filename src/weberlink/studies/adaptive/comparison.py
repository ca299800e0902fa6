"""Rows of the study, and how often one encoder sends against another: ratios, geometric means, worst cases."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from math import exp, log
from typing import Any

from weberlink.codec.predictors import HYBRID
from weberlink.studies.adaptive.signals import Half, Kind
from weberlink.studies.curves import Band, Observation, curves

MOST_RATIO = 1.05
"""Limit of the packets, relative to the best single predictor."""
FEW_PER_S = 10.0
"""Below this packet rate of the best single predictor, the difference [1/s] counts instead of the ratio."""
MOST_MORE_PER_S = 1.0


@dataclass(frozen=True)
class RateRow:
    """How often one signal was sent in one part of the study."""

    part: str
    signal: str
    group: str
    half: Half
    kind: Kind
    noise_n: float
    variant: str
    floor_n: float
    packets: int
    packets_per_s: float
    outside: int = 0
    """Ticks outside their deadband; must be 0."""


@dataclass(frozen=True)
class MatchRow:
    """The felt force of one signal at the packet rate of the hybrid."""

    signal: str
    group: str
    half: Half
    kind: Kind
    variant: str
    weber: float
    packets: int
    packets_per_s: float
    error_rms_n: float
    error_rms_jnd: float
    largest_step_n: float
    step_jnd: float
    """99.9th percentile."""
    outside: int = 0


@dataclass(frozen=True)
class CostRow:
    """Run time of encode plus decode per tick."""

    variant: str
    ticks: int
    median_us: float
    mean_us: float
    p99_us: float
    worst_us: float
    differing: int = 0
    """Ticks after which the states of encoder and decoder were not bit-identical; must be 0."""


@dataclass(frozen=True)
class AdaptiveResults:
    """All rows of the study."""

    rates: list[RateRow] = field(default_factory=list)
    matches: list[MatchRow] = field(default_factory=list)
    costs: list[CostRow] = field(default_factory=list)

    def of(self, part: str, **fields: object) -> list[RateRow]:
        """Rows of a part of the study whose fields have these values."""
        return chosen(self.rates, part=part, **fields)

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def chosen(rows: Iterable[RateRow], **fields: object) -> list[RateRow]:
    """Rows whose fields have these values."""
    return [row for row in rows if all(getattr(row, name) == value for name, value in fields.items())]


@dataclass(frozen=True)
class SignalRatio:
    """A figure of one encoder over that of another, on one signal."""

    signal: str
    group: str
    value: float


def ratios(rows: Iterable[RateRow], variant: str, reference: str) -> list[SignalRatio]:
    """Packets of `variant` over those of `reference`, for every signal that both send."""
    return _ratios(list(rows), variant, reference, "packets")


def felt_ratios(
    matches: Iterable[MatchRow],
    variant: str,
    figure: str,
    reference: str = HYBRID,
    signals: Iterable[str] | None = None,
) -> list[SignalRatio]:
    """A figure of `variant` over that of `reference` at equal packets, for every signal (of `signals`) with both."""
    wanted = None if signals is None else set(signals)
    listed = [row for row in matches if wanted is None or row.signal in wanted]
    return _ratios(listed, variant, reference, figure)


def _ratios(
    rows: Sequence[RateRow] | Sequence[MatchRow], variant: str, reference: str, figure: str
) -> list[SignalRatio]:
    under = {row.signal: getattr(row, figure) for row in rows if row.variant == reference}
    return [
        SignalRatio(row.signal, row.group, getattr(row, figure) / under[row.signal])
        for row in rows
        if row.variant == variant and under.get(row.signal, 0) > 0 and getattr(row, figure) > 0
    ]


def geometric_mean(found: Sequence[SignalRatio]) -> Band | None:
    """Geometric mean over groups with its 95 % bootstrap interval; None without ratios.

    The ratios of a group are averaged first.
    """
    if not found:
        return None
    logs = [Observation(one.group, "", 0.0, one.value, log(one.value)) for one in found]
    ((point,),) = curves(logs).values()
    mean, low, high = point.quality
    return Band(exp(mean), exp(low), exp(high))


@dataclass(frozen=True)
class BestSingle:
    """The packet rate of one signal beside that of its best single predictor."""

    signal: str
    group: str
    per_s: float
    single: str
    single_per_s: float

    @property
    def ratio(self) -> float | None:
        return self.per_s / self.single_per_s if self.single_per_s > 0.0 else None

    @property
    def within(self) -> bool:
        """Whether it is at most 1.05 times the best or, where that is below 10/s, at most 1/s more."""
        if self.single_per_s < FEW_PER_S:
            return self.per_s <= self.single_per_s + MOST_MORE_PER_S
        return self.per_s <= MOST_RATIO * self.single_per_s


def against_best(rows: Iterable[RateRow], variant: str, singles: Sequence[str]) -> list[BestSingle]:
    """Every signal that has rows of all `singles`; the first of equal ones is the best."""
    listed = list(rows)
    rates = packet_rates(listed)
    found = []
    for row in chosen(listed, variant=variant):
        if all((row.signal, name) in rates for name in singles):
            best = min(singles, key=lambda name: rates[row.signal, name])
            found.append(BestSingle(row.signal, row.group, row.packets_per_s, best, rates[row.signal, best]))
    return found


def against_best_ratios(found: Iterable[BestSingle]) -> list[SignalRatio]:
    """The ratios of the signals that both send."""
    return [SignalRatio(one.signal, one.group, one.ratio) for one in found if one.ratio]


def packet_rates(rows: Iterable[RateRow]) -> dict[tuple[str, str], float]:
    """Packets per second by signal and variant."""
    return {(row.signal, row.variant): row.packets_per_s for row in rows}
