"""Packets at equal quality: the packet rate at which each predictor's mean rating is at a level, and what it saves."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

RESAMPLES = 2000
CONFIDENCE = 0.95
LEAST_SHARE = 0.95
"""Of the resamples that must have a saving, for an interval to be told."""

Table = NDArray[np.float64]


class Reach(Enum):
    """Whether a curve comes to a level."""

    CROSSES = "crosses"
    BELOW = "not reached"
    """Rated lower even at the smallest Weber factor."""
    ABOVE = "above throughout"
    """Rated higher even at the largest Weber factor: the packet rate there is an upper bound."""


@dataclass(frozen=True)
class Crossing:
    """Where a curve is at a level; the packet rate [1/s] is None if it never is."""

    reach: Reach
    packets_per_s: float | None


@dataclass(frozen=True)
class Saving:
    """Packets of one predictor against another's at the same mean rating.

    Args:
        share: saved, 1 for all of them, negative for more packets; None if one of them does not come to the level.
        low: end of the 95 % confidence interval over subjects; None if there is none.
        high: the other end.
        at_least: whether the predictor is above the level throughout, so that it saves so much or more.
    """

    share: float | None
    low: float | None
    high: float | None
    at_least: bool

    def as_json(self) -> dict[str, Any]:
        return {"share": self.share, "low": self.low, "high": self.high, "at_least": self.at_least}


def crossing(rates: Sequence[float] | Table, ratings: Sequence[float] | Table, level: float) -> Crossing:
    """Where a predictor's curve falls below a level.

    The rating is taken as never rising with the Weber factor (`falling`); between two Weber factors it lies on a
    straight line over the packet rate.

    Args:
        rates: packets per second, by rising Weber factor.
        ratings: mean ratings, likewise.
        level: of the scale.
    """
    smooth = falling(ratings)
    at_or_above = [place for place, rating in enumerate(smooth) if rating >= level]
    if not at_or_above:
        return Crossing(Reach.BELOW, None)
    last = at_or_above[-1]
    if last == len(smooth) - 1:
        return Crossing(Reach.ABOVE, float(rates[last]))
    share = (smooth[last] - level) / (smooth[last] - smooth[last + 1])
    return Crossing(Reach.CROSSES, float(rates[last] + share * (rates[last + 1] - rates[last])))


def falling(values: Sequence[float] | Table) -> list[float]:
    """The sequence that never rises and is nearest in least squares: pool adjacent violators."""
    blocks: list[tuple[float, int]] = []
    for value in values:
        blocks.append((float(value), 1))
        while len(blocks) > 1 and blocks[-2][0] < blocks[-1][0]:
            (right, more), (left, some) = blocks.pop(), blocks.pop()
            blocks.append(((left * some + right * more) / (some + more), some + more))
    return [mean for mean, count in blocks for _ in range(count)]


def savings(
    rates: Table, ratings: Table, level: float, base: int, *, seed: int = 0
) -> tuple[list[Crossing], list[Saving]]:
    """Every predictor against one of them, with a percentile bootstrap over subjects.

    Args:
        rates: packets per second, shape (subjects, predictors, Weber factors).
        ratings: likewise.
        level: of the scale.
        base: place of the predictor to compare with.
        seed: of the bootstrap.

    Returns:
        Crossing and saving of each predictor, in order.
    """
    found = _crossings(rates, ratings, level)
    shares = [_share(one, found[base]) for one in found]
    subjects = len(rates)
    if subjects < 2:
        return found, [
            Saving(share, None, None, one.reach is Reach.ABOVE) for one, share in zip(found, shares, strict=True)
        ]
    drawn = np.random.default_rng(seed).integers(subjects, size=(RESAMPLES, subjects))
    resampled: list[list[float]] = [[] for _ in found]
    for draw in drawn:
        again = _crossings(rates[draw], ratings[draw], level)
        for mine, one in zip(resampled, again, strict=True):
            share = _share(one, again[base])
            if share is not None:
                mine.append(share)
    return found, [
        Saving(share, *_interval(mine if share is not None else []), one.reach is Reach.ABOVE)
        for one, share, mine in zip(found, shares, resampled, strict=True)
    ]


def _crossings(rates: Table, ratings: Table, level: float) -> list[Crossing]:
    means = zip(rates.mean(axis=0), ratings.mean(axis=0), strict=True)
    return [crossing(rate, rating, level) for rate, rating in means]


def _share(one: Crossing, base: Crossing) -> float | None:
    """None against a base whose packet rate is only bounded: less may be needed, and so less saved."""
    if one.packets_per_s is None or base.reach is not Reach.CROSSES or not base.packets_per_s:
        return None
    return 1.0 - one.packets_per_s / base.packets_per_s


def _interval(shares: Sequence[float]) -> tuple[float | None, float | None]:
    if len(shares) < LEAST_SHARE * RESAMPLES:
        return None, None
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(shares, [tail, 100.0 - tail])
    return float(low), float(high)
