"""Answers of all subjects of a study, read from a folder of ledgers; refuses ledgers that are not comparable."""

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from weberlink.studies.curves import Observation
from weberlink.studies.experiment.ledger import LedgerError, SubjectProgress, path_of, read, subjects
from weberlink.studies.experiment.plan import CodingCondition, TrialPlan
from weberlink.studies.paper.claims import PREDICTORS

Whose = Literal["people", "simulated"]
COLUMNS = ("subject", "simulated", "trial", "attempt", "predictor", "weber", "rating")
FIGURES = (
    "packets_per_s", "reduction", "error_rms", "violation_fraction",
    "error_rms_jnd", "log_error_rms_jnd", "jump_median_jnd", "jump_p99_jnd", "jump_max_jnd",
)  # fmt: skip


@dataclass(frozen=True)
class TrialRating:
    """One rated trial."""

    subject: int
    trial: int
    attempt: int
    condition: CodingCondition
    rating: int
    figures: Mapping[str, Any]


@dataclass(frozen=True)
class StudyRatings:
    """Answers of all subjects who have rated every trial.

    Args:
        plan: of one of them; the others are compatible with it.
        answers: in the order of subjects and trials.
        incomplete: subjects that are left out, with their number of rated trials. Their last conditions are missing,
            so means would compare different people.
    """

    plan: TrialPlan
    answers: Sequence[TrialRating]
    incomplete: Mapping[int, int]

    @property
    def simulated(self) -> bool:
        return self.plan.simulated

    @property
    def subjects(self) -> list[int]:
        return sorted({answer.subject for answer in self.answers})

    @property
    def observations(self) -> list[Observation]:
        """One for each rating, ordered by predictor."""
        ranked = sorted(self.answers, key=lambda answer: self.predictors.index(answer.condition.predictor))
        return [
            Observation(
                f"{'simulated' if self.simulated else 'subject'} {answer.subject}",
                answer.condition.predictor,
                answer.condition.weber,
                float(answer.figures["packets_per_s"]),
                float(answer.rating),
            )
            for answer in ranked
        ]

    @property
    def scale(self) -> dict[int, str]:
        """Words that the subjects read for each level, the best first."""
        return {level: self.plan.wording[level] for level in sorted(self.plan.wording, reverse=True)}

    @property
    def predictors(self) -> list[str]:
        """In the order of the paper."""
        names = {condition.predictor for condition in self.plan.trials}
        return [name for name in PREDICTORS if name in names] + sorted(names - {*PREDICTORS})

    @property
    def webers(self) -> list[float]:
        return sorted({condition.weber for condition in self.plan.trials})

    def ratings(self) -> NDArray[np.float64]:
        """Shape (subjects, predictors, Weber factors)."""
        return self._table(lambda answer: float(answer.rating))

    def packet_rates(self) -> NDArray[np.float64]:
        """Shape (subjects, predictors, Weber factors) [1/s]."""
        return self._table(lambda answer: float(answer.figures["packets_per_s"]))

    def write_csv(self, path: Path) -> None:
        """Write one row for each rating, in the order of the ratings.

        Raises:
            OSError: if the file cannot be written.
        """
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow([*COLUMNS, *FIGURES])
            for answer in self.answers:
                writer.writerow(
                    [
                        answer.subject,
                        str(self.simulated).lower(),
                        answer.trial,
                        answer.attempt,
                        answer.condition.predictor,
                        answer.condition.weber,
                        answer.rating,
                        *(answer.figures.get(name) for name in FIGURES),
                    ]
                )

    def _table(self, value: Callable[[TrialRating], float]) -> NDArray[np.float64]:
        table = np.full((len(self.subjects), len(self.predictors), len(self.webers)), np.nan)
        for answer in self.answers:
            place = (
                self.subjects.index(answer.subject),
                self.predictors.index(answer.condition.predictor),
                self.webers.index(answer.condition.weber),
            )
            table[place] = value(answer)
        return table


def gather(folder: Path, whose: Whose | None) -> StudyRatings:
    """The answers in a folder.

    Args:
        folder: with ledgers; an experiment may be writing to one of them.
        whose: of people or of simulated subjects; None if the folder has one kind only.

    Raises:
        LedgerError: if there is nothing to analyse, a ledger is damaged, or they cannot be compared.
    """
    found = {kind: subjects(folder, simulated=kind == "simulated") for kind in ("people", "simulated")}
    if whose is None:
        if all(found.values()):
            raise LedgerError(
                f"{folder}: has ledgers of people and of a program, which cannot be analysed together; "
                "choose with --only people or --only simulated"
            )
        whose = "simulated" if found["simulated"] else "people"
    ledgers = {subject: _read(folder, subject, whose) for subject in found[whose]}
    begun = {subject: progress for subject, progress in ledgers.items() if progress is not None}
    complete = {subject: progress for subject, progress in begun.items() if not progress.remaining}
    if not complete:
        raise LedgerError(f"{folder}: no {_kind(whose)} has rated all trials; {len(ledgers)} incomplete")
    first, *others = complete
    for other in others:
        _check_alike(folder, whose, complete[first].plan, complete[other].plan)
    return StudyRatings(
        plan=complete[first].plan,
        answers=[answer for subject, progress in complete.items() for answer in _answers(subject, progress)],
        incomplete={
            subject: len(progress.rated) if progress is not None else 0
            for subject, progress in ledgers.items()
            if subject not in complete
        },
    )


def _read(folder: Path, subject: int, whose: Whose) -> SubjectProgress | None:
    path = path_of(folder, subject, simulated=whose == "simulated")
    progress = read(path)
    if progress is None:
        return None
    plan = progress.plan
    if plan.simulated != (whose == "simulated") or plan.subject != subject:
        is_of = f"{'simulated ' if plan.simulated else ''}subject {plan.subject}"
        raise LedgerError(f"{path}:1: is the ledger of {is_of}, which does not match its file name")
    for number, entry in progress.rated.items():
        rate = entry.figures.get("packets_per_s")
        if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0.0 <= rate < inf:
            raise LedgerError(f"{path}: trial {number}: expected figures with packets_per_s, not {rate!r}")
    return progress


def _check_alike(folder: Path, whose: Whose, one: TrialPlan, other: TrialPlan) -> None:
    """Check that two subjects took part in the same study.

    Raises:
        LedgerError: if they did not.
    """
    paths = [path_of(folder, plan.subject, simulated=whose == "simulated") for plan in (one, other)]
    for differs, what in (
        (one.digest != other.digest, "another configuration"),
        (one.duration_s != other.duration_s, "trials of another length"),
        (dict(one.wording) != dict(other.wording), "another wording of the scale"),
        (set(one.trials) != set(other.trials), "other trials"),
    ):
        if differs:
            raise LedgerError(f"{paths[1]}: has {what} than {paths[0]}; put each study into a folder of its own")


def _answers(subject: int, progress: SubjectProgress) -> list[TrialRating]:
    return [
        TrialRating(
            subject,
            number,
            entry.attempt,
            progress.plan.trials[number - 1],
            entry.rating,
            entry.figures,
        )
        for number, entry in sorted(progress.rated.items())
    ]


def _kind(whose: Whose) -> str:
    return "simulated subject" if whose == "simulated" else "person"
