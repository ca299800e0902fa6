"""The order of an experiment: training, trials with breaks, a rating after each, all written to the ledger."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import Any, Protocol

from weberlink_studies.experiment.ledger import (
    BreakTaken,
    Ledger,
    ReferenceFelt,
    SubjectProgress,
    TrainingDone,
    TrialBegun,
    TrialFailed,
    TrialRated,
)
from weberlink_studies.experiment.plan import BREAK_EVERY, HIGHEST, LOWEST, REFERENCES, CodingCondition, TrialPlan

Elapsed = Callable[[float | None], None]
"""Receives the elapsed time of a trial [s] several times a second, and None at its end."""
WIDTH = 78
GUIDE = (
    "You move the device in your hand and feel a remote scene. The signal that you feel may be changed in different "
    "ways, and more or less strongly. After each trial, rate it on this scale:"
)
TRAINING = (
    "The training has {references} references, which show you the scale; you may repeat each one. {trials} trials of "
    "{seconds:g} s follow, with a break after every {every}. You feel and rate each trial once. Press Ctrl-C to leave; "
    "you can continue later."
)
RATING_S = 8.0  # estimated time between two trials [s]
AGAIN = "r"


class SubjectLeft(Exception):  # noqa: N818 - not an error
    """The subject has left; all ratings are in the ledger."""


class ConductError(Exception):
    """The experiment cannot continue; the text is one line."""


@dataclass(frozen=True)
class FeltTrial:
    """A signal that the subject feels."""

    condition: CodingCondition  # of the coding
    name: str  # does not reveal the condition: `trial-07`, `training-1`
    number: int  # unique for this subject; seeds a simulated trial


@dataclass(frozen=True)
class TrialResult:
    """The result of a trial."""

    figures: Mapping[str, Any]  # objective figures, as stored
    problem: str | None = None  # reason why it cannot be rated; None if it can
    interrupted: bool = False  # whether the subject asked to stop


@dataclass(frozen=True)
class Prompt:
    """What the subject reads and is asked. It does not reveal the condition of a trial."""

    text: Sequence[str] = ()  # lines to read
    question: str = ""  # to be answered; empty if there is none
    answers: Sequence[str] = ("",)  # one of them is the answer, "" for Enter alone
    otherwise: str = "Please press Enter alone."  # said after another answer
    felt: TrialResult | None = None  # the signal that was felt last, if the prompt is about it
    rated: int | None = None  # number of the trial that is to be rated; None for another question


class TrialRunner(Protocol):
    """Runs trials."""

    def feel(self, trial: FeltTrial, recording: Path | None, elapsed: Elapsed) -> TrialResult:
        """Run a trial to its end."""
        ...


class Subject(Protocol):
    """A person or program that feels and rates."""

    def answer(self, prompt: Prompt) -> str:
        """One of the answers of the prompt; "" if it has no question."""
        ...

    def elapsed(self, seconds: float | None) -> None:
        """Called during a trial, see `Elapsed`."""
        ...


class Conduct:
    """One subject's experiment; it continues where the ledger ends."""

    def __init__(self, ledger: Ledger, runner: TrialRunner, subject: Subject, recordings: Path | None) -> None:
        assert ledger.progress is not None
        self._ledger = ledger
        self._progress = ledger.progress
        self._runner = runner
        self._ask = subject.answer
        self._elapsed = subject.elapsed
        self._recordings = recordings

    def run(self) -> None:
        """Run to the end."""
        try:
            self._ask(Prompt(_welcome(self._progress)))
            if not self._progress.trained:
                self._train()
            for number in self._progress.remaining:
                self._rest(number - 1)
                self._rate(number)
            self._ask(Prompt(["", "That was the last trial. Thank you."]))
        except KeyboardInterrupt:
            raise SubjectLeft from None

    def _train(self) -> None:
        for place, reference in enumerate(REFERENCES):
            again = place not in self._progress.references
            while again:
                level = f"this is level {reference.level}, {self._progress.plan.wording[reference.level]}."
                self._ask(
                    Prompt(
                        ["", f"Reference {place + 1} of {len(REFERENCES)}: {level}"],
                        "Take the device in your hand, then press Enter to start: ",
                    )
                )
                felt, where = self._feel(FeltTrial(reference.condition, f"training-{place + 1}", -1 - place))
                if felt.problem is not None:
                    self._repeat("reference", felt)
                    continue
                self._ledger.append(ReferenceFelt(reference=place, level=reference.level, **where))
                question = "Press Enter to continue, or r to feel it again: "
                otherwise = "Please press Enter alone, or r and Enter."
                again = self._ask(Prompt((), question, ("", AGAIN), otherwise, felt)) == AGAIN
        self._ledger.append(TrainingDone())

    def _rest(self, after: int) -> None:
        if after and after % BREAK_EVERY == 0 and after not in self._progress.breaks:
            text = f"{after} of {len(self._progress.plan.trials)} trials are done: a break."
            self._ask(
                Prompt(["", f"{text} Let go of the device and rest your hand."], "When you are ready, press Enter: ")
            )
            self._ledger.append(BreakTaken(after=after))

    def _rate(self, number: int) -> None:
        """One trial, repeated until it can be rated."""
        plan = self._progress.plan
        condition = plan.trials[number - 1]
        while number not in self._progress.rated:
            self._ask(Prompt([""], f"Trial {number} of {len(plan.trials)}. Press Enter to start: "))
            self._ledger.append(TrialBegun(trial=number))
            felt, where = self._feel(FeltTrial(condition, f"trial-{number:02d}", number))
            where |= {"trial": number, "attempt": self._progress.begun[number]}
            if felt.problem is not None:
                self._ledger.append(TrialFailed(problem=felt.problem, **where))
                self._repeat("trial", felt)
                continue
            answers = [str(level) for level in range(LOWEST, HIGHEST + 1)]
            question = f"Rating {LOWEST} to {HIGHEST}: "
            otherwise = f"Please type one number from {LOWEST} to {HIGHEST}, and Enter."
            rating = int(self._ask(Prompt(_scale(plan), question, answers, otherwise, felt, number)))
            self._ledger.append(
                TrialRated(rating=rating, predictor=condition.predictor, weber=condition.weber, **where)
            )

    def _repeat(self, what: str, felt: TrialResult) -> None:
        self._ask(Prompt([f"This {what} does not count and is repeated: {felt.problem}"], felt=felt))

    def _feel(self, trial: FeltTrial) -> tuple[TrialResult, dict[str, Any]]:
        """The result of a trial, and the fields of its entry."""
        recording = self._recording(trial.name)
        try:
            felt = self._runner.feel(trial, recording, self._elapsed)
        finally:
            self._elapsed(None)
        if felt.interrupted:
            raise SubjectLeft
        where = None if recording is None else f"{recording.parent.name}/{recording.name}"
        return felt, {"figures": dict(felt.figures), "recording": where}

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


def _scale(plan: TrialPlan) -> list[str]:
    return [f"  {level}  {plan.wording[level]}" for level in sorted(plan.wording, reverse=True)]


def _welcome(progress: SubjectProgress) -> list[str]:
    plan, remaining = progress.plan, len(progress.remaining)
    minutes = (remaining * (plan.duration_s + RATING_S) + (0 if progress.trained else 60)) / 60.0
    training = TRAINING.format(
        references=len(REFERENCES), trials=len(plan.trials), seconds=plan.duration_s, every=BREAK_EVERY
    )
    rated = f"The training is done, and {len(progress.rated)} trials are rated."
    return [
        "", f"Subject {plan.subject}: {remaining} trials, about {max(1, round(minutes))} minutes", "",
        *wrap(GUIDE, WIDTH), "", *_scale(plan), "", *wrap(rated if progress.trained else training, WIDTH),
    ]  # fmt: skip
