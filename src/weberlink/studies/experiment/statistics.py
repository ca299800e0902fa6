"""Tests of ratings, which are ordinal and repeated: each subject rated everything. Needs scipy (extra: statistics)."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

LEAST_SUBJECTS = 6
"""Below this a two-sided signed-rank test cannot reach 5 %, whatever the ratings: its least p is 2 / 2^n."""
APPROXIMATE_TO = 10
"""Up to so many subjects the chi-squared distribution of Friedman's statistic is a rough approximation."""

Table = NDArray[np.float64]


@dataclass(frozen=True)
class Friedman:
    """Whether levels of a factor differ at all.

    Args:
        subjects: number of rows.
        chi_squared: statistic; None if no subject made any difference.
        degrees: of freedom.
        p: None where it would say nothing.
        kendalls_w: agreement of the subjects, 0 to 1: chi-squared over its largest value.
        remark: what to know of it.
    """

    subjects: int
    chi_squared: float | None
    degrees: int
    p: float | None
    kendalls_w: float | None
    remark: str | None

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


@dataclass(frozen=True)
class SignedRank:
    """Whether one level is rated otherwise than another.

    Args:
        name: of the level.
        median_difference: to the other one.
        w: smaller sum of signed ranks.
        p: two-sided; None where it would say nothing.
        p_holm: the same, after Holm's correction for as many comparisons as there are.
    """

    name: str
    median_difference: float
    w: float | None
    p: float | None
    p_holm: float | None

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def friedman(table: Table) -> Friedman:
    """Friedman's test, corrected for ties.

    Args:
        table: shape (subjects, levels), at least 3 levels.
    """
    subjects, levels = table.shape
    if not _enough(subjects):
        return Friedman(subjects, None, levels - 1, None, None, too_few(subjects))
    if np.all(table == table[:, :1]):
        return Friedman(subjects, None, levels - 1, None, 0.0, "nobody made any difference")
    result = stats.friedmanchisquare(*table.T)
    chi_squared = float(result.statistic)
    remark = f"approximate with {subjects} subjects" if subjects <= APPROXIMATE_TO else None
    return Friedman(
        subjects, chi_squared, levels - 1, float(result.pvalue), chi_squared / (subjects * (levels - 1)), remark
    )


def against(base: Sequence[float] | Table, others: Mapping[str, Sequence[float] | Table]) -> list[SignedRank]:
    """Wilcoxon's signed-rank test of each level against one, with Holm's correction.

    Differences of 0 are left out, as Wilcoxon did; with ties, and few subjects, the distribution is that of all signs.

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
    """Step-down correction of Holm (1979); what is None stays so, and does not count."""
    known = sorted((p, place) for place, p in enumerate(ps) if p is not None)
    corrected: list[float | None] = [None] * len(ps)
    largest = 0.0
    for rank, (p, place) in enumerate(known):
        largest = max(largest, min(1.0, (len(known) - rank) * p))
        corrected[place] = largest
    return corrected


def too_few(subjects: int) -> str:
    return f"too few subjects for a test: {subjects}, needs {LEAST_SUBJECTS}"


def _enough(subjects: int) -> bool:
    return subjects >= LEAST_SUBJECTS


def _signed_rank(base: Table, values: Table) -> tuple[float, float | None, float | None]:
    # Means over the same number of whole ratings: what differs by less than a billionth is equal.
    differences = np.round(values - base, 9)
    median = float(np.median(differences))
    if not _enough(len(differences)):
        return median, None, None
    if not np.any(differences):
        return median, 0.0, 1.0
    result = stats.wilcoxon(differences[differences != 0.0])
    return median, float(result.statistic), float(result.pvalue)
