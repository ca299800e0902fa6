"""Analysis of the ratings: means with confidence, tests, packets at equal quality. Needs scipy (extra: studies)."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from weberlink.studies.curves import CurvePoint, Curves, curves
from weberlink.studies.experiment.answers import StudyRatings
from weberlink.studies.experiment.statistics import Crossing, Friedman, Saving, SignedRank, against, friedman, savings

SEED = 0
"""Seed of the bootstrap."""
MARK = "SIMULATED RATINGS"
EXPLANATION = "a program rated by a rule from the felt error; no person took part"
BASES = ("zoh", "linear")
"""Predictors with which the paper compares packets."""
TESTED_AGAINST = "zoh"


@dataclass(frozen=True)
class Analysis:
    """An analysed study.

    Args:
        answers: of all complete subjects.
        curves: mean ratings and packet rates.
        by_predictor: test over each subject's means over Weber factors.
        by_weber: test over each subject's means over predictors.
        against: tests of each other predictor against `TESTED_AGAINST`.
        level: of the scale, at which packets are compared.
        crossings: packet rate at the level, by predictor.
        savings: packets saved at the level, by base of the comparison and predictor.
    """

    answers: StudyRatings
    curves: Curves
    by_predictor: Friedman
    by_weber: Friedman
    against: Sequence[SignedRank]
    level: float
    crossings: Mapping[str, Crossing]
    savings: Mapping[str, Mapping[str, Saving]]

    @property
    def mark(self) -> str | None:
        """The mark of simulated ratings; None if people rated."""
        return MARK if self.answers.simulated else None

    @property
    def who(self) -> str:
        """Number and kind of the subjects."""
        count = len(self.answers.subjects)
        return f"{count} {'simulated ' if self.answers.simulated else ''}{'subject' if count == 1 else 'subjects'}"

    @property
    def document(self) -> dict[str, Any]:
        answers = self.answers
        return {
            "simulated": answers.simulated,
            "mark": f"{MARK}: {EXPLANATION}" if answers.simulated else None,
            "subjects": answers.subjects,
            "incomplete": [{"subject": subject, "rated": rated} for subject, rated in answers.incomplete.items()],
            "duration_s": answers.plan.duration_s,
            "wording": dict(answers.plan.wording),
            "configuration_digest": answers.plan.digest,
            "rows": [_row(point) for points in self.curves.values() for point in points],
            "tests": {
                "friedman_predictors": asdict(self.by_predictor),
                "friedman_webers": asdict(self.by_weber),
                f"signed_rank_against_{TESTED_AGAINST}": [asdict(test) for test in self.against],
            },
            "savings": {
                "level": self.level,
                "predictors": [
                    {"predictor": name, "reach": crossing.reach.value, "packets_per_s": crossing.packets_per_s}
                    | {f"fewer_than_{base}": asdict(by_name[name]) for base, by_name in self.savings.items()}
                    for name, crossing in self.crossings.items()
                ],
            },
            "seed": SEED,
        }


def analyse(answers: StudyRatings, level: float) -> Analysis:
    """Analyse the ratings of all complete subjects; packets are compared at `level` of the scale."""
    rates, ratings, names = answers.packet_rates(), answers.ratings(), answers.predictors
    over_webers = ratings.mean(axis=2)
    means = dict(zip(names, over_webers.T, strict=True))
    base_means = means.pop(TESTED_AGAINST)
    crossings: dict[str, Crossing] = {}
    saved: dict[str, dict[str, Saving]] = {}
    for base in BASES:
        found, shares = savings(rates, ratings, level, names.index(base), seed=SEED)
        crossings, saved[base] = dict(zip(names, found, strict=True)), dict(zip(names, shares, strict=True))
    return Analysis(
        answers,
        curves(answers.observations, seed=SEED),
        friedman(over_webers),
        friedman(ratings.mean(axis=1)),
        against(base_means, means),
        level,
        crossings,
        saved,
    )


def _row(point: CurvePoint) -> dict[str, Any]:
    return {
        "predictor": point.predictor,
        "weber": point.weber,
        "subjects": point.units,
        "rating": point.quality._asdict(),
        "packets_per_s": point.packets_per_s._asdict(),
    }
