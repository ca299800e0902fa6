"""Statistics of ratings: rank tests for repeated ordinal data, and packets saved at equal quality.

Needs scipy (extra: studies) for the tests.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

LEAST_SUBJECTS = 6
"""With fewer subjects a two-sided signed-rank test cannot reach 5 %: its smallest p is 2 / 2^n."""
APPROXIMATE_TO = 10
"""Up to this number of subjects the chi-squared distribution is a rough approximation of Friedman's statistic."""
RESAMPLES = 2000
CONFIDENCE = 0.95
LEAST_SHARE = 0.95
"""Share of the resamples that must have a saving to report an interval."""

Table = NDArray[np.float64]


@dataclass(frozen=True)
class Friedman:
    """Friedman's test: do the levels of a factor differ?

    Args:
        subjects: number of rows.
        chi_squared: statistic; None if every subject rated all levels alike.
        degrees: of freedom.
        p: None without a test.
        kendalls_w: agreement of the subjects, 0 to 1: chi-squared over its largest value.
        remark: for the reader.
    """

    subjects: int
    chi_squared: float | None
    degrees: int
    p: float | None
    kendalls_w: float | None
    remark: str | None


@dataclass(frozen=True)
class SignedRank:
    """Wilcoxon's signed-rank test of one level against another.

    Args:
        name: of the level.
        median_difference: to the other one.
        w: smaller sum of signed ranks.
        p: two-sided; None without a test.
        p_holm: after Holm's correction for the number of comparisons.
    """

    name: str
    median_difference: float
    w: float | None
    p: float | None
    p_holm: float | None


def friedman(table: Table) -> Friedman:
    """Friedman's test, corrected for ties.

    Args:
        table: shape (subjects, levels), at least 3 levels.
    """
    subjects, levels = table.shape
    if subjects < LEAST_SUBJECTS:
        few = f"too few subjects for a test: {subjects}, needs {LEAST_SUBJECTS}"
        return Friedman(subjects, None, levels - 1, None, None, few)
    if np.all(table == table[:, :1]):
        return Friedman(subjects, None, levels - 1, None, 0.0, "every subject rated all levels alike")
    from scipy import stats  # noqa: PLC0415 - an extra

    result = stats.friedmanchisquare(*table.T)
    chi_squared = float(result.statistic)
    remark = f"approximate with {subjects} subjects" if subjects <= APPROXIMATE_TO else None
    return Friedman(
        subjects, chi_squared, levels - 1, float(result.pvalue), chi_squared / (subjects * (levels - 1)), remark
    )


def against(base: Sequence[float] | Table, others: Mapping[str, Sequence[float] | Table]) -> list[SignedRank]:
    """Wilcoxon's signed-rank test of each level against one, with Holm's correction.

    Differences of 0 are left out (Wilcoxon); with ties and few subjects the distribution is exact over all signs.

    Args:
        base: one number per subject.
        others: likewise, by name.
    """
    tested = [_signed_rank(np.asarray(base), np.asarray(values)) for values in others.values()]
    corrected = holm([p for _, _, p in tested])
    return [
        SignedRank(name, median, w, p, p_holm)
        for name, (median, w, p), p_holm in zip(others, tested, corrected, strict=True)
    ]


def holm(ps: Sequence[float | None]) -> list[float | None]:
    """Step-down correction of Holm (1979); None stays None and does not count."""
    known = sorted((p, place) for place, p in enumerate(ps) if p is not None)
    corrected: list[float | None] = [None] * len(ps)
    largest = 0.0
    for rank, (p, place) in enumerate(known):
        largest = max(largest, min(1.0, (len(known) - rank) * p))
        corrected[place] = largest
    return corrected


def _signed_rank(base: Table, values: Table) -> tuple[float, float | None, float | None]:
    # Ratings are means of integers: smaller differences are rounding.
    differences = np.round(values - base, 9)
    median = float(np.median(differences))
    if len(differences) < LEAST_SUBJECTS:
        return median, None, None
    if not np.any(differences):
        return median, 0.0, 1.0
    from scipy import stats  # noqa: PLC0415 - an extra

    result = stats.wilcoxon(differences[differences != 0.0])
    return median, float(result.statistic), float(result.pvalue)


class Reach(Enum):
    """Whether a curve reaches a level."""

    CROSSES = "crosses"
    BELOW = "not reached"
    """Below the level even at the smallest Weber factor."""
    ABOVE = "above throughout"
    """Above the level even at the largest Weber factor, where the packet rate is an upper bound."""


@dataclass(frozen=True)
class Crossing:
    """The packet rate [1/s] at which a curve is at a level; None if it never reaches it."""

    reach: Reach
    packets_per_s: float | None


@dataclass(frozen=True)
class Saving:
    """Packets of one predictor against another's at the same mean rating.

    Args:
        share: saved packets, 1 for all, negative for more packets; None if one of them does not reach the level.
        low: end of the 95 % confidence interval over subjects; None if there is none.
        high: the other end.
        at_least: whether `share` is a lower bound, because the predictor is above the level throughout.
    """

    share: float | None
    low: float | None
    high: float | None
    at_least: bool


def crossing(rates: Sequence[float] | Table, ratings: Sequence[float] | Table, level: float) -> Crossing:
    """The packet rate at which the curve of a predictor falls below a level.

    Ratings are made monotone in the Weber factor (`falling`) and interpolated linearly over the packet rate.

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
    """The nearest non-increasing sequence in least squares (pool adjacent violators)."""
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
    """None if the packet rate of the base is only an upper bound."""
    if one.packets_per_s is None or base.reach is not Reach.CROSSES or not base.packets_per_s:
        return None
    return 1.0 - one.packets_per_s / base.packets_per_s


def _interval(shares: Sequence[float]) -> tuple[float | None, float | None]:
    if len(shares) < LEAST_SHARE * RESAMPLES:
        return None, None
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(shares, [tail, 100.0 - tail])
    return float(low), float(high)
