"""Answers of all subjects of a study, read from a folder of ledgers; refuses ledgers that are not comparable."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path

from weberlink_studies.experiment.ledger import LedgerError, SubjectProgress, path_of, read, subjects
from weberlink_studies.experiment.plan import TrialPlan
from weberlink_studies.frame import Row

FIGURES = (
    "packets_per_s", "reduction", "error_rms", "violation_fraction",
    "error_rms_jnd", "log_error_rms_jnd", "jump_median_jnd", "jump_p99_jnd", "jump_max_jnd",
)  # fmt: skip
PEOPLE, SIMULATED = "people", "simulated"


@dataclass(frozen=True)
class StudyRatings:
    """The ledgers of all subjects who have rated every trial."""

    complete: Sequence[SubjectProgress]  # in the order of their numbers; at least one, and all comparable
    # subjects that are left out, with their number of rated trials. Their last conditions are missing, so means would
    # compare different people.
    incomplete: Mapping[int, int]

    @property
    def plan(self) -> TrialPlan:
        """That of the first subject; the others are compatible with it."""
        return self.complete[0].plan


def rows_of(progress: SubjectProgress) -> list[Row]:
    """A row for each rating of a subject, in the order of the trials."""
    return [
        {
            "subject": progress.plan.subject,
            "simulated": progress.plan.simulated,
            "trial": number,
            "attempt": entry.attempt,
            "predictor": entry.predictor,
            "weber": entry.weber,
            "rating": entry.rating,
            **{name: entry.figures.get(name) for name in FIGURES},
        }
        for number, entry in sorted(progress.rated.items())
    ]


def gather(folder: Path, whose: str | None) -> StudyRatings:
    """The answers in a folder."""
    found = {kind: subjects(folder, simulated=kind == SIMULATED) for kind in (PEOPLE, SIMULATED)}
    if whose is None and all(found.values()):
        raise LedgerError(
            f"{folder}: has ledgers of people and of a program, which cannot be analysed together; "
            "choose with --only people or --only simulated"
        )
    whose = whose or (SIMULATED if found[SIMULATED] else PEOPLE)
    paths = {subject: path_of(folder, subject, simulated=whose == SIMULATED) for subject in found[whose]}
    ledgers = {subject: read(path) for subject, path in paths.items()}
    complete: dict[int, SubjectProgress] = {}
    for subject, progress in ledgers.items():
        if progress is not None:
            _check(progress, paths[subject], subject, whose)
            if not progress.remaining:
                complete[subject] = progress
    if not complete:
        kind = "simulated subject" if whose == SIMULATED else "person"
        raise LedgerError(f"{folder}: no {kind} has rated all trials; {len(ledgers)} incomplete")
    first, *others = complete
    for other in others:
        _check_alike(complete[first].plan, complete[other].plan, paths[first], paths[other])
    incomplete = {
        subject: len(progress.rated) if progress is not None else 0
        for subject, progress in ledgers.items()
        if subject not in complete
    }
    return StudyRatings(list(complete.values()), incomplete)


def _check(progress: SubjectProgress, path: Path, subject: int, whose: str) -> None:
    plan = progress.plan
    if plan.simulated != (whose == SIMULATED) or plan.subject != subject:
        is_of = f"{'simulated ' if plan.simulated else ''}subject {plan.subject}"
        raise LedgerError(f"{path}:1: is the ledger of {is_of}, which does not match its file name")
    for number, entry in progress.rated.items():
        rate = entry.figures.get("packets_per_s")
        if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0.0 <= rate < inf:
            raise LedgerError(f"{path}: trial {number}: expected figures with packets_per_s, not {rate!r}")


def _check_alike(one: TrialPlan, other: TrialPlan, first: Path, second: Path) -> None:
    """Check that two subjects took part in the same study."""
    for differs, what in (
        (one.digest != other.digest, "another configuration"),
        (one.duration_s != other.duration_s, "trials of another length"),
        (one.wording != other.wording, "another wording of the scale"),
        (set(one.trials) != set(other.trials), "other trials"),
    ):
        if differs:
            raise LedgerError(f"{second}: has {what} than {first}; put each study into a folder of its own")
