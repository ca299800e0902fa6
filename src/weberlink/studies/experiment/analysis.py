"""Analysis of the ratings: means with confidence, tests, packets at equal quality. Needs scipy (extra: statistics)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from weberlink.studies.curves import CurvePoint, Curves, curves
from weberlink.studies.experiment.answers import Answers
from weberlink.studies.experiment.statistics import Crossing, Friedman, Saving, SignedRank, against, friedman, savings

SEED = 0
"""Seed of the bootstrap."""
MARK = "SIMULATED RATINGS"
EXPLANATION = "a program rated by a rule from the felt error; no person took part"
BASES = ("zoh", "linear")
"""Predictors with which the paper compares packets."""
TESTED_AGAINST = "zoh"


@dataclass(frozen=True)
class RankTests:
    """Rank tests of the ratings.

    Args:
        predictors: over each subject's means over Weber factors.
        webers: over each subject's means over predictors.
        against: each other predictor against `TESTED_AGAINST`.
    """

    predictors: Friedman
    webers: Friedman
    against: Sequence[SignedRank]

    def as_json(self) -> dict[str, Any]:
        return {
            "friedman_predictors": self.predictors.as_json(),
            "friedman_webers": self.webers.as_json(),
            f"signed_rank_against_{TESTED_AGAINST}": [test.as_json() for test in self.against],
        }


@dataclass(frozen=True)
class Savings:
    """Packets at a level of the scale.

    Args:
        level: of the scale.
        crossings: by predictor.
        against: by the base of the comparison, then by predictor.
    """

    level: float
    crossings: Mapping[str, Crossing]
    against: Mapping[str, Mapping[str, Saving]]

    def as_json(self) -> dict[str, Any]:
        return {
            "level": self.level,
            "predictors": [
                {"predictor": name, "reach": crossing.reach.value, "packets_per_s": crossing.packets_per_s}
                | {f"fewer_than_{base}": by_name[name].as_json() for base, by_name in self.against.items()}
                for name, crossing in self.crossings.items()
            ],
        }


@dataclass(frozen=True)
class Analysis:
    """An analysed study."""

    answers: Answers
    curves: Curves
    tests: RankTests
    savings: Savings

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
            "tests": self.tests.as_json(),
            "savings": self.savings.as_json(),
            "seed": SEED,
        }


def analyse(answers: Answers, level: float) -> Analysis:
    """Analyse the ratings.

    Args:
        answers: of all complete subjects.
        level: rating at which packets are compared.
    """
    found = curves(answers.observations, seed=SEED)
    return Analysis(answers, found, _tests(answers), _all_savings(answers, level))


def _tests(answers: Answers) -> RankTests:
    ratings = answers.ratings()
    over_webers = ratings.mean(axis=2)
    by_predictor = dict(zip(answers.predictors, over_webers.T, strict=True))
    base = by_predictor.pop(TESTED_AGAINST)
    return RankTests(friedman(over_webers), friedman(ratings.mean(axis=1)), against(base, by_predictor))


def _all_savings(answers: Answers, level: float) -> Savings:
    rates, ratings = answers.packet_rates(), answers.ratings()
    names = answers.predictors
    crossings: dict[str, Crossing] = {}
    by_base: dict[str, dict[str, Saving]] = {}
    for base in BASES:
        found, saved = savings(rates, ratings, level, names.index(base), seed=SEED)
        crossings = dict(zip(names, found, strict=True))
        by_base[base] = dict(zip(names, saved, strict=True))
    return Savings(level, crossings, by_base)


def _row(point: CurvePoint) -> dict[str, Any]:
    return {
        "predictor": point.predictor,
        "weber": point.weber,
        "subjects": point.units,
        "rating": point.quality._asdict(),
        "packets_per_s": point.packets_per_s._asdict(),
    }
