"""How often one codec sends against another, over signals: ratios, their geometric mean and how sure it is, exceptions.

Knows rows, and not how they came about.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import exp, log

from weberlink.studies.adaptive.rows import Rate, chosen
from weberlink.studies.curves import Band, Observation, curves

MOST_RATIO = 1.05
"""Of the best single predictor's packets."""
FEW_PER_S = 10.0
"""Signals that the best single sends less often than this are judged by the difference."""
MOST_MORE_PER_S = 1.0


@dataclass(frozen=True)
class Ratio:
    """One signal with both."""

    signal: str
    group: str
    value: float


def ratios(rows: Iterable[Rate], variant: str, reference: str) -> list[Ratio]:
    """Packets of one over those of the other, for every signal that both send."""
    listed = list(rows)
    under = {row.signal: row for row in chosen(listed, variant=reference)}
    return [
        Ratio(row.signal, row.group, row.packets / under[row.signal].packets)
        for row in chosen(listed, variant=variant)
        if row.signal in under and row.packets and under[row.signal].packets
    ]


def geometric_mean(found: Sequence[Ratio]) -> Band | None:
    """Over groups, with the 95 % confidence of a bootstrap over them; signals of a group are averaged first.

    None without any.
    """
    if not found:
        return None
    logs = [Observation(one.group, "", 0.0, one.value, log(one.value)) for one in found]
    ((point,),) = curves(logs).values()
    mean, low, high = point.quality
    return Band(exp(mean), exp(low), exp(high))


@dataclass(frozen=True)
class Best:
    """A signal against the best of single predictors.

    Args:
        signal: which.
        per_s: of the codec that is judged.
        single: name of the best.
        single_per_s: what that sends.
    """

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
        """Whether it keeps the law: at most 1.05 of the best; where that is under 10/s, at most 1/s more."""
        if self.single_per_s < FEW_PER_S:
            return self.per_s <= self.single_per_s + MOST_MORE_PER_S
        return self.per_s <= MOST_RATIO * self.single_per_s


def against_best(rows: Iterable[Rate], variant: str, singles: Sequence[str]) -> list[Best]:
    """Every signal that was coded with all of them; ties go to the first."""
    listed = list(rows)
    rates: Mapping[tuple[str, str], float] = {(row.signal, row.variant): row.packets_per_s for row in listed}
    found = []
    for row in chosen(listed, variant=variant):
        if all((row.signal, name) in rates for name in singles):
            best = min(singles, key=lambda name: rates[row.signal, name])
            found.append(Best(row.signal, row.group, row.packets_per_s, best, rates[row.signal, best]))
    return found


def against_best_ratios(found: Iterable[Best]) -> list[Ratio]:
    """Of those where both send."""
    return [Ratio(one.signal, one.group, one.ratio) for one in found if one.ratio]
