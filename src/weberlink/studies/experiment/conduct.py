"""How an experiment goes: the training, the trials with their breaks, a rating after each, all of it in the ledger.

Owns the order of things and what is written when. It does not know how a trial is run, or whether a person or a
program sits in front of it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from weberlink.studies.experiment.ledger import BEGUN, BREAK, FAILED, RATED, REFERENCE, TRAINED, Ledger, Progress
from weberlink.studies.experiment.plan import BREAK_EVERY, Condition
from weberlink.studies.experiment.scale import REFERENCES, Reference

Elapsed = Callable[[float], None]
"""Told how long a trial has lasted [s], some times a second."""


class Left(Exception):  # noqa: N818 - it is no error
    """The subject has left; all that is rated is in the ledger."""


class ConductError(Exception):
    """The experiment cannot go on; the text is one line."""


@dataclass(frozen=True)
class Trial:
    """A signal to be felt.

    Args:
        condition: how it is coded.
        name: tells nothing of the condition: `trial-07`, `training-1`.
        number: among all that this subject feels, for what there is of chance in a simulated one.
    """

    condition: Condition
    name: str
    number: int


@dataclass(frozen=True)
class Felt:
    """What came of a trial.

    Args:
        figures: objective ones, as they are stored.
        problem: why it cannot be rated; None if it can.
        interrupted: whether the subject asked to stop.
    """

    figures: Mapping[str, Any]
    problem: str | None = None
    interrupted: bool = False


class Apparatus(Protocol):
    """Lets a signal be felt."""

    def feel(self, trial: Trial, recording: Path | None, elapsed: Elapsed) -> Felt:
        """Run a trial to its end; nothing is left of it but its recording."""
        ...


class Subject(Protocol):
    """Whoever feels and rates. Every call may raise `Left`."""

    def welcome(self, progress: Progress) -> None:
        """Before anything else, also after the subject had left."""
        ...

    def prepare_reference(self, place: int, reference: Reference) -> None:
        """Before a reference of the training, whose level the subject is told."""
        ...

    def learn(self, reference: Reference, felt: Felt) -> bool:
        """After a reference; returns whether to feel it once more."""
        ...

    def prepare(self, number: int, of: int) -> None:
        """Before a trial; `number` counts from 1."""
        ...

    def elapsed(self, seconds: float) -> None:
        """While something is felt."""
        ...

    def rate(self, number: int, felt: Felt) -> int:
        """After a trial: a level of the scale."""
        ...

    def repeat(self, what: str, problem: str) -> None:
        """Something was felt to no purpose, and comes again."""
        ...

    def rest(self, after: int, of: int) -> None:
        """A break."""
        ...

    def farewell(self) -> None:
        """All is rated."""
        ...

    def leave(self) -> None:
        """The subject left, at whatever moment."""
        ...


class Conduct:
    """One subject's experiment, from wherever the ledger says it is.

    Args:
        ledger: with a plan in it.
        apparatus: runs trials.
        subject: feels and rates.
        recordings: folder for a recording of each trial, which must be there; None to record nothing.
    """

    def __init__(self, ledger: Ledger, apparatus: Apparatus, subject: Subject, recordings: Path | None) -> None:
        assert ledger.progress is not None
        self._ledger = ledger
        self._progress = ledger.progress
        self._apparatus = apparatus
        self._subject = subject
        self._recordings = recordings

    def run(self) -> None:
        """Go on to the end.

        Raises:
            Left: if the subject leaves, or asked for the end of a trial.
            ConductError: if a simulated subject cannot do it.
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
        except (Left, KeyboardInterrupt):
            self._subject.leave()
            raise Left from None

    def _train(self) -> None:
        for place, reference in enumerate(REFERENCES):
            again = place not in self._progress.references
            while again:
                self._subject.prepare_reference(place, reference)
                name = f"training-{place + 1}"
                recording = self._recording(name)
                felt = self._feel(Trial(reference.condition, name, -1 - place), recording)
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
        """One trial, until it could be rated."""
        condition = self._progress.plan.trials[number - 1]
        name = f"trial-{number:02d}"
        while number not in self._progress.rated:
            self._subject.prepare(number, of)
            self._ledger.append(BEGUN, trial=number)
            attempt = self._progress.begun[number]
            recording = self._recording(name)
            felt = self._feel(Trial(condition, name, number), recording)
            facts = {"trial": number, "attempt": attempt, "figures": felt.figures} | self._where(recording)
            if felt.problem is not None:
                self._ledger.append(FAILED, problem=felt.problem, **facts)
                self._subject.repeat("trial", felt.problem)
                continue
            rating = self._subject.rate(number, felt)
            self._ledger.append(RATED, rating=rating, predictor=condition.predictor, weber=condition.weber, **facts)

    def _feel(self, trial: Trial, recording: Path | None) -> Felt:
        felt = self._apparatus.feel(trial, recording, self._subject.elapsed)
        if felt.interrupted:
            raise Left
        return felt

    def _recording(self, name: str) -> Path | None:
        """A name that no recording has yet: what was felt once stays, whatever came of it."""
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
