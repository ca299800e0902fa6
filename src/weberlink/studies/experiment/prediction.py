"""Rating predicted from a measure of quality: a straight line, fitted to ratings of people and to nothing else.

Least squares over all trials; the interval is that of a percentile bootstrap over subjects, each drawn with all of its
trials, because the ratings of one person are dependent (Efron and Tibshirani, An Introduction to the Bootstrap, 1993).
Ratings are ordinal: the line takes the distances between levels as equal, as their means do.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weberlink.studies.curves import Band
from weberlink.studies.experiment.answers import StudyRatings, TrialRating
from weberlink.studies.experiment.plan import HIGHEST, LOWEST

MEASURES = {
    "error_rms_jnd": "error, RMS",
    "log_error_rms_jnd": "log error, RMS",
    "jump_median_jnd": "jump, median",
}
"""Measures that may predict a rating, by their key among the figures of a trial."""
POINTS_JND = (0.5, 1.0, 2.0)
"""Values of a measure for which predictions are printed."""
LEAST_SUBJECTS = 2
"""With one subject there is no interval."""
RESAMPLES = 2000
CONFIDENCE = 0.95

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PredictedRating:
    """A fitted line.

    Args:
        measure: key of the measure.
        trials: number of ratings.
        range_jnd: smallest and largest value of the measure in them.
        at_none: rating at a measure of 0, with its 95 % confidence interval over subjects.
        per_jnd: change of the rating per JND.
        points: predicted mean rating at those of `POINTS_JND` that lie in the range, within the scale.
        scatter: standard deviation of single ratings about the line.
    """

    measure: str
    trials: int
    range_jnd: tuple[float, float]
    at_none: Band
    per_jnd: Band
    points: dict[float, Band]
    scatter: float

    def as_json(self) -> dict[str, Any]:
        points = [{"jnd": jnd, "rating": band._asdict()} for jnd, band in self.points.items()]
        bands = {"at_none": self.at_none._asdict(), "per_jnd": self.per_jnd._asdict()}
        return asdict(self) | bands | {"points": points}


def predictions(answers: StudyRatings, *, seed: int) -> list[PredictedRating]:
    """A line for each measure that the trials have.

    Args:
        answers: of a study.
        seed: of the bootstrap.

    Returns:
        Nothing for simulated subjects, for fewer than `LEAST_SUBJECTS` people, and for a measure that the ledgers of
        an earlier release lack or that never differs.
    """
    if answers.simulated or len(answers.subjects) < LEAST_SUBJECTS:
        return []
    found = (_fit(answers.answers, measure, seed) for measure in MEASURES)
    return [one for one in found if one is not None]


def _fit(answers: Sequence[TrialRating], measure: str, seed: int) -> PredictedRating | None:
    known = [one for one in answers if _is_number(one.figures.get(measure))]
    subjects = sorted({one.subject for one in known})
    x = np.array([one.figures[measure] for one in known], dtype=np.float64)
    y = np.array([one.rating for one in known], dtype=np.float64)
    if len(subjects) < LEAST_SUBJECTS or x.min() == x.max():
        return None
    whose = np.array([subjects.index(one.subject) for one in known])
    # Sums of each subject: those of a resample are sums of these.
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y])
    sums = np.stack([terms[:, whose == each].sum(axis=1) for each in range(len(subjects))])
    drawn = np.random.default_rng(seed).integers(len(subjects), size=(RESAMPLES, len(subjects)))
    at_none, per_jnd = _line(sums.sum(axis=0)[None, :])
    again_at_none, again_per_jnd = _line(sums[drawn].sum(axis=1))

    def band(jnd: float, share: float) -> Band:
        return _band(share * at_none + jnd * per_jnd, share * again_at_none + jnd * again_per_jnd)

    low, high = float(x.min()), float(x.max())
    residual = y - at_none - per_jnd * x
    return PredictedRating(
        measure=measure,
        trials=len(known),
        range_jnd=(low, high),
        at_none=band(0.0, 1.0),
        per_jnd=band(1.0, 0.0),
        points={jnd: _on_scale(band(jnd, 1.0)) for jnd in POINTS_JND if low <= jnd <= high},
        scatter=float(np.sqrt(np.square(residual).sum() / max(1, len(known) - 2))),
    )


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


def _line(sums: Array) -> tuple[Array, Array]:
    """Least-squares intercept and slope from sums over samples of 1, x, y, x^2 and x y, in the last axis of `sums`.

    NaN where all x are equal.
    """
    n, x, y, xx, xy = np.moveaxis(sums, -1, 0)
    spread = n * xx - x * x
    slope = np.divide(n * xy - x * y, spread, out=np.full_like(spread, np.nan), where=spread > 1e-9 * n * xx)
    return (y - slope * x) / n, slope


def _band(found: Array, again: Array) -> Band:
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.nanpercentile(again, [tail, 100.0 - tail])
    value = float(found[0])
    return Band(value, min(value, float(low)), max(value, float(high)))


def _on_scale(band: Band) -> Band:
    return Band(*(min(float(HIGHEST), max(float(LOWEST), value)) for value in band))
