"""The order of an experiment: training, trials with breaks, a rating after each, all written to the ledger."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from weberlink.studies.experiment.ledger import BEGUN, BREAK, FAILED, RATED, REFERENCE, TRAINED, Ledger, SubjectProgress
from weberlink.studies.experiment.plan import BREAK_EVERY, REFERENCES, CodingCondition, TrainingReference

Elapsed = Callable[[float], None]
"""Receives the elapsed time of a trial [s] several times a second."""


class SubjectLeft(Exception):  # noqa: N818 - not an error
    """The subject has left; all ratings are in the ledger."""


class ConductError(Exception):
    """The experiment cannot continue; the text is one line."""


@dataclass(frozen=True)
class FeltTrial:
    """A signal that the subject feels.

    Args:
        condition: of the coding.
        name: does not reveal the condition: `trial-07`, `training-1`.
        number: unique for this subject; seeds a simulated trial.
    """

    condition: CodingCondition
    name: str
    number: int


@dataclass(frozen=True)
class TrialResult:
    """The result of a trial.

    Args:
        figures: objective figures, as stored.
        problem: reason why it cannot be rated; None if it can.
        interrupted: whether the subject asked to stop.
    """

    figures: Mapping[str, Any]
    problem: str | None = None
    interrupted: bool = False


class TrialRunner(Protocol):
    """Runs trials."""

    def feel(self, trial: FeltTrial, recording: Path | None, elapsed: Elapsed) -> TrialResult:
        """Run a trial to its end."""
        ...


class Subject(Protocol):
    """A person or program that feels and rates. Every call may raise `SubjectLeft`."""

    def welcome(self, progress: SubjectProgress) -> None:
        """Called first, also when an experiment continues."""
        ...

    def prepare_reference(self, place: int, reference: TrainingReference) -> None:
        """Called before a reference of the training; tells its level."""
        ...

    def learn(self, reference: TrainingReference, felt: TrialResult) -> bool:
        """Called after a reference; returns whether to repeat it."""
        ...

    def prepare(self, number: int, of: int) -> None:
        """Called before a trial; `number` counts from 1."""
        ...

    def elapsed(self, seconds: float) -> None:
        """Called during a trial."""
        ...

    def rate(self, number: int, felt: TrialResult) -> int:
        """Rate a trial: a level of the scale."""
        ...

    def repeat(self, what: str, problem: str) -> None:
        """Called when a trial or reference must be repeated."""
        ...

    def rest(self, after: int, of: int) -> None:
        """Take a break."""
        ...

    def farewell(self) -> None:
        """Called after the last rating."""
        ...

    def leave(self) -> None:
        """Called when the subject leaves."""
        ...


class Conduct:
    """One subject's experiment; it continues where the ledger ends.

    Args:
        ledger: with a plan in it.
        runner: runs trials.
        subject: feels and rates.
        recordings: existing folder for a recording of each trial; None to record nothing.
    """

    def __init__(self, ledger: Ledger, runner: TrialRunner, subject: Subject, recordings: Path | None) -> None:
        assert ledger.progress is not None
        self._ledger = ledger
        self._progress = ledger.progress
        self._runner = runner
        self._subject = subject
        self._recordings = recordings

    def run(self) -> None:
        """Run to the end.

        Raises:
            SubjectLeft: if the subject leaves or interrupts a trial.
            ConductError: if a simulated subject cannot rate.
            OSError: if the ledger cannot be written; it ends with the trial before.
        """
        try:
            self._subject.welcome(self._progress)
            if not self._progress.trained:
                self._train()
            of = len(self._progress.plan.trials)
            for number in self._progress.remaining:
                self._rest(number - 1, of)
                self._rate(number, of)
            self._subject.farewell()
        except (SubjectLeft, KeyboardInterrupt):
            self._subject.leave()
            raise SubjectLeft from None

    def _train(self) -> None:
        for place, reference in enumerate(REFERENCES):
            again = place not in self._progress.references
            while again:
                self._subject.prepare_reference(place, reference)
                name = f"training-{place + 1}"
                recording = self._recording(name)
                felt = self._feel(FeltTrial(reference.condition, name, -1 - place), recording)
                if felt.problem is not None:
                    self._subject.repeat("reference", felt.problem)
                    continue
                self._ledger.append(
                    REFERENCE, reference=place, level=reference.level, figures=felt.figures, **self._where(recording)
                )
                again = self._subject.learn(reference, felt)
        self._ledger.append(TRAINED)

    def _rest(self, after: int, of: int) -> None:
        if after and after % BREAK_EVERY == 0 and after not in self._progress.breaks:
            self._subject.rest(after, of)
            self._ledger.append(BREAK, after=after)

    def _rate(self, number: int, of: int) -> None:
        """One trial, repeated until it can be rated."""
        condition = self._progress.plan.trials[number - 1]
        name = f"trial-{number:02d}"
        while number not in self._progress.rated:
            self._subject.prepare(number, of)
            self._ledger.append(BEGUN, trial=number)
            attempt = self._progress.begun[number]
            recording = self._recording(name)
            felt = self._feel(FeltTrial(condition, name, number), recording)
            facts = {"trial": number, "attempt": attempt, "figures": felt.figures} | self._where(recording)
            if felt.problem is not None:
                self._ledger.append(FAILED, problem=felt.problem, **facts)
                self._subject.repeat("trial", felt.problem)
                continue
            rating = self._subject.rate(number, felt)
            self._ledger.append(RATED, rating=rating, predictor=condition.predictor, weber=condition.weber, **facts)

    def _feel(self, trial: FeltTrial, recording: Path | None) -> TrialResult:
        felt = self._runner.feel(trial, recording, self._subject.elapsed)
        if felt.interrupted:
            raise SubjectLeft
        return felt

    def _recording(self, name: str) -> Path | None:
        """A file name that is not taken, so that no recording is overwritten."""
        if self._recordings is None:
            return None
        path = self._recordings / f"{name}.mcap"
        attempt = 1
        while path.exists():
            attempt += 1
            path = self._recordings / f"{name}-{attempt}.mcap"
        return path

    @staticmethod
    def _where(recording: Path | None) -> dict[str, str]:
        return {} if recording is None else {"recording": f"{recording.parent.name}/{recording.name}"}
