"""Statistics of ratings: rank tests for repeated ordinal data, and packets saved at equal quality.

Needs scipy and statsmodels (extra: studies).
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pandas import DataFrame

LEAST_SUBJECTS = 6  # with fewer subjects a two-sided signed-rank test cannot reach 5 %: its smallest p is 2 / 2^n
APPROXIMATE_TO = 10
"""Up to this number of subjects the chi-squared distribution is a rough approximation of Friedman's statistic."""
RESAMPLES = 2000
CONFIDENCE = 0.95
LEAST_SHARE = 0.95  # share of the resamples that must have a saving to report an interval
CROSSES, BELOW, ABOVE = "crosses", "not reached", "above throughout"
"""Whether a curve reaches a level. Below: even at the smallest Weber factor. Above: even at the largest one, where the
packet rate is an upper bound."""

Table = NDArray[np.float64]


def friedman(table: "DataFrame | Table") -> dict[str, Any]:
    """Friedman's test, corrected for ties: do the levels of a factor differ?

    Args:
        table: shape (subjects, levels), at least 3 levels.

    Returns:
        Numbers of subjects and degrees of freedom, chi_squared (None if every subject rated all levels alike), p (None
        without a test), kendalls_w (agreement of the subjects, 0 to 1: chi-squared over its largest value) and remark.
    """
    values = np.asarray(table)
    subjects, levels = values.shape
    found: dict[str, Any] = {"subjects": subjects, "chi_squared": None, "degrees": levels - 1, "p": None}
    if subjects < LEAST_SUBJECTS:
        few = f"too few subjects for a test: {subjects}, needs {LEAST_SUBJECTS}"
        return found | {"kendalls_w": None, "remark": few}
    if np.all(values == values[:, :1]):
        return found | {"kendalls_w": 0.0, "remark": "every subject rated all levels alike"}
    from scipy import stats  # noqa: PLC0415 - an extra

    chi_squared, p = map(float, stats.friedmanchisquare(*values.T))
    return found | {
        "chi_squared": chi_squared,
        "p": p,
        "kendalls_w": chi_squared / (subjects * (levels - 1)),
        "remark": f"approximate with {subjects} subjects" if subjects <= APPROXIMATE_TO else None,
    }


def against(table: "DataFrame", base: str) -> list[dict[str, Any]]:
    """Wilcoxon's signed-rank test of each column against one, two-sided, with Holm's correction.

    Differences of 0 are left out (Wilcoxon); with ties and few subjects the distribution is exact over all signs.

    Returns:
        For each other column its name, median_difference, w (the smaller sum of signed ranks), p and p_holm; None
        without a test.
    """
    from scipy import stats  # noqa: PLC0415 - an extra
    from statsmodels.stats.multitest import multipletests  # noqa: PLC0415

    # Ratings are means of integers: smaller differences are rounding.
    differences = table.drop(columns=base).sub(table[base], axis=0).round(9)
    found = [{"name": name, "median_difference": float(differences[name].median())} for name in differences]
    if len(table) < LEAST_SUBJECTS:
        return [one | {"w": None, "p": None, "p_holm": None} for one in found]
    signed = [differences[name][differences[name] != 0.0] for name in differences]
    tests = [tuple(map(float, stats.wilcoxon(each))) if len(each) else (0.0, 1.0) for each in signed]
    corrected = multipletests([p for _, p in tests], method="holm")[1]
    return [
        one | {"w": w, "p": p, "p_holm": float(p_holm)}
        for one, (w, p), p_holm in zip(found, tests, corrected, strict=True)
    ]


def crossing(rates: Sequence[float] | Table, ratings: Sequence[float] | Table, level: float) -> tuple[float, str]:
    """The packet rate [1/s] at which the curve of a predictor falls below a level, NaN if it is below throughout.

    Ratings become the nearest sequence in least squares that never rises with the Weber factor, and are interpolated
    linearly over the packet rate.

    Returns:
        The rate, and `CROSSES`, `BELOW` or `ABOVE`.
    """
    from scipy.optimize import isotonic_regression  # noqa: PLC0415 - an extra

    smooth = isotonic_regression(np.asarray(ratings), increasing=False).x
    last = int(np.count_nonzero(smooth >= level)) - 1
    if last < 0:
        return np.nan, BELOW
    if last == len(smooth) - 1:
        return float(rates[last]), ABOVE
    share = (smooth[last] - level) / (smooth[last] - smooth[last + 1])
    return float(rates[last] + share * (rates[last + 1] - rates[last])), CROSSES


def savings(rates: Table, ratings: Table, level: float, bases: Sequence[int], *, seed: int = 0) -> list[dict[str, Any]]:
    """Packets of every predictor at the same mean rating, and those saved against some of them.

    Args:
        rates: packets per second, shape (subjects, predictors, Weber factors).
        ratings: likewise.
        level: of the scale.
        bases: places of the predictors to compare with.
        seed: of the bootstrap.

    Returns:
        For each predictor reach, packets_per_s (None if it never reaches the level) and fewer_than, by the place of the
        base: share of its packets that is saved (None if one of both does not reach the level, or the rate of the base
        is only an upper bound), low and high of its percentile interval over subjects (None if there is none), and
        at_least, whether it is a lower bound because the predictor is above the level throughout.
    """
    subjects, predictors = rates.shape[:2]

    def crossings(drawn: NDArray[np.int64]) -> list[tuple[float, str]]:
        means = zip(rates[drawn].mean(axis=0), ratings[drawn].mean(axis=0), strict=True)
        return [crossing(rate, rating, level) for rate, rating in means]

    def shares(drawn: NDArray[np.int64]) -> Table:
        """Saved shares, shape (bases * predictors), NaN for none."""
        found = crossings(drawn)
        at = np.array([rate for rate, _ in found])
        of = np.array([rate if reach == CROSSES and rate > 0.0 else np.nan for rate, reach in found])
        saved: Table = (1.0 - at / of[list(bases), None]).ravel()
        return saved

    everybody = np.arange(subjects)
    saved = shares(everybody)
    drawn = np.random.default_rng(seed).integers(subjects, size=(RESAMPLES if subjects > 1 else 0, subjects))
    resampled = np.array([shares(draw) for draw in drawn]).reshape(len(drawn), saved.size)
    tail = 50.0 * (1.0 - CONFIDENCE)
    found = []
    for place, (rate, reach) in enumerate(crossings(everybody)):
        fewer = {}
        for number, base in enumerate(bases):
            index = number * predictors + place
            known = resampled[np.isfinite(resampled[:, index]), index]
            is_sure = np.isfinite(saved[index]) and known.size >= LEAST_SHARE * RESAMPLES
            low, high = np.percentile(known, [tail, 100.0 - tail]) if is_sure else (np.nan, np.nan)
            ends = {"share": saved[index], "low": low, "high": high}
            fewer[base] = {name: None if np.isnan(end) else float(end) for name, end in ends.items()}
            fewer[base]["at_least"] = reach == ABOVE
        found.append({"reach": reach, "packets_per_s": None if np.isnan(rate) else rate, "fewer_than": fewer})
    return found
