"""Subjects of an experiment: a person at a terminal, and a program that rates by a rule.

A person sees the elapsed time and nothing else of a signal. The program tests the study and its analysis; it is no
model of a person. It rates the RMS felt error in just noticeable differences (JND) on a scale that it learns in the
training: the references have the levels 5, 3 and 1; between them, and beyond the last, levels are linear in the error.
Noise, seeded per subject and trial, is added, and the result is rounded. Such ratings are marked as simulated.
"""

import termios
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from random import Random
from textwrap import wrap
from typing import TextIO

from weberlink.studies.experiment.conduct import ConductError, SubjectLeft, TrialResult
from weberlink.studies.experiment.ledger import SubjectProgress
from weberlink.studies.experiment.plan import (
    BREAK_EVERY,
    HIGHEST,
    LOWEST,
    REFERENCES,
    TrainingReference,
    TrialPlan,
    rating_of,
)

WIDTH = 78
BAR = 40
GUIDE = (
    "You move the device in your hand and feel a remote scene. The signal that you feel may be changed in different "
    "ways, and more or less strongly. After each trial, rate it on this scale:"
)
TRAINING = (
    "The training has {references} references, which show you the scale; you may repeat each one. {trials} trials of "
    "{seconds:g} s follow, with a break after every {every}. You feel and rate each trial once. Press Ctrl-C to leave; "
    "you can continue later."
)
RATING_S = 8.0
"""Estimated time between two trials [s]."""


class Person:
    """A person at two text streams, such as a terminal.

    Args:
        source: of the input.
        screen: for the output.
        plan: with the wording of the scale and the length of a trial.
    """

    def __init__(self, source: TextIO, screen: TextIO, plan: TrialPlan) -> None:
        self._source = source
        self._screen = screen
        self._duration_s = plan.duration_s
        self._wording: Mapping[str, str] = plan.wording
        self._bar_is_shown = False

    def welcome(self, progress: SubjectProgress) -> None:
        plan = progress.plan
        remaining = len(progress.remaining)
        minutes = (remaining * (plan.duration_s + RATING_S) + (0 if progress.trained else 60)) / 60.0
        self._tell("", f"Subject {plan.subject}: {remaining} trials, about {max(1, round(minutes))} minutes", "")
        self._tell(*wrap(GUIDE, WIDTH), "", *self._scale(), "")
        if progress.trained:
            self._tell(f"The training is done, and {len(progress.rated)} trials are rated.", "")
            return
        text = TRAINING.format(
            references=len(REFERENCES), trials=len(plan.trials), seconds=plan.duration_s, every=BREAK_EVERY
        )
        self._tell(*wrap(text, WIDTH), "")

    def prepare_reference(self, place: int, reference: TrainingReference) -> None:
        self._tell(
            f"Reference {place + 1} of {len(REFERENCES)}: this is level {reference.level}, "
            f"{self._wording[str(reference.level)]}."
        )
        self._ask("Take the device in your hand, then press Enter to start: ")

    def learn(self, reference: TrainingReference, felt: TrialResult) -> bool:  # noqa: ARG002
        self._clear()
        while (answer := self._ask("Press Enter to continue, or r to feel it again: ").lower()) not in (
            "",
            "r",
        ):
            self._tell("Please press Enter alone, or r and Enter.")
        self._tell("")
        return answer == "r"

    def prepare(self, number: int, of: int) -> None:
        self._ask(f"Trial {number} of {of}. Press Enter to start: ")

    def elapsed(self, seconds: float) -> None:
        if not self._screen.isatty():
            return
        share = min(1.0, max(0.0, seconds / self._duration_s))
        filled = round(share * BAR)
        left = f"{max(0.0, self._duration_s - seconds):4.0f} s left" if seconds > 0.0 else "starting "
        self._screen.write(f"\r  [{'#' * filled}{'.' * (BAR - filled)}] {left} ")
        self._screen.flush()
        self._bar_is_shown = True

    def rate(self, number: int, felt: TrialResult) -> int:  # noqa: ARG002
        self._clear()
        self._tell(*self._scale())
        while (rating := rating_of(self._ask(f"Rating {LOWEST} to {HIGHEST}: "))) is None:
            self._tell(f"Please type one number from {LOWEST} to {HIGHEST}, and Enter.")
        self._tell("")
        return rating

    def repeat(self, what: str, problem: str) -> None:
        self._clear()
        self._tell(f"This {what} does not count and is repeated: {problem}")

    def rest(self, after: int, of: int) -> None:
        self._tell(f"{after} of {of} trials are done: a break. Let go of the device and rest your hand.")
        self._ask("When you are ready, press Enter: ")
        self._tell("")

    def farewell(self) -> None:
        self._tell("That was the last trial. Thank you.")

    def leave(self) -> None:
        self._clear()

    def _scale(self) -> list[str]:
        levels = sorted(self._wording, key=int, reverse=True)
        return [f"  {level}  {self._wording[level]}" for level in levels]

    def _ask(self, prompt: str) -> str:
        """Ask for a line of input.

        Raises:
            SubjectLeft: at the end of input or on Ctrl-C.
        """
        self._forget_typed()
        self._screen.write(prompt)
        self._screen.flush()
        try:
            line = self._source.readline()
        except KeyboardInterrupt:
            line = ""
        if not line:
            self._tell("")
            raise SubjectLeft
        return line.strip()

    def _forget_typed(self) -> None:
        """Drop earlier input, so that a key pressed during a trial does not count as a rating."""
        if self._source.isatty():
            with suppress(termios.error, OSError):
                termios.tcflush(self._source.fileno(), termios.TCIFLUSH)

    def _clear(self) -> None:
        """Remove the progress bar."""
        if self._bar_is_shown:
            self._screen.write("\r" + " " * WIDTH + "\r")
            self._bar_is_shown = False

    def _tell(self, *lines: str) -> None:
        self._screen.write("".join(f"{line}\n" for line in lines))
        self._screen.flush()


FELT = "error_rms_jnd"
"""The figure that is rated."""
SPREAD = 0.5
"""Standard deviation of the noise on a level before rounding."""


class SimulatedSubject:
    """A program that rates by the rule above.

    Args:
        plan: of a simulated subject.
        report: receives the number of rated trials and of all trials.
    """

    def __init__(self, plan: TrialPlan, report: Callable[[int, int], None]) -> None:
        assert plan.simulated
        self._plan = plan
        self._report = report
        self._anchors: dict[int, float] = {}

    def welcome(self, progress: SubjectProgress) -> None:
        for place, figures in progress.references.items():
            if FELT not in figures:
                raise ConductError(f"the training has no {FELT}: it is of an earlier release; begin another subject")
            self._anchors[REFERENCES[place].level] = float(figures[FELT])
        self._report(len(progress.rated), len(progress.plan.trials))

    def prepare_reference(self, place: int, reference: TrainingReference) -> None:
        pass

    def learn(self, reference: TrainingReference, felt: TrialResult) -> bool:
        self._anchors[reference.level] = float(felt.figures[FELT])
        return False

    def prepare(self, number: int, of: int) -> None:
        if number == 1:
            self._check_anchors()
        self._report(number - 1, of)

    def elapsed(self, seconds: float) -> None:
        pass

    def rate(self, number: int, felt: TrialResult) -> int:
        """The level of the felt error plus noise, rounded."""
        chance = Random(f"{self._plan.seed}/{self._plan.subject}/rating/{number}")  # noqa: S311 - must be repeatable
        anchors = [(self._anchors[reference.level], reference.level) for reference in REFERENCES]
        level = level_of(float(felt.figures[FELT]), anchors) + chance.gauss(0.0, SPREAD)
        return min(HIGHEST, max(LOWEST, round(level)))

    def repeat(self, what: str, problem: str) -> None:
        """Fail, because a repetition in virtual time would have the same problem.

        Raises:
            ConductError: always.
        """
        raise ConductError(f"a simulated {what} cannot be rated: {problem}")

    def rest(self, after: int, of: int) -> None:
        pass

    def farewell(self) -> None:
        of = len(self._plan.trials)
        self._report(of, of)

    def leave(self) -> None:
        pass

    def _check_anchors(self) -> None:
        errors = [self._anchors[reference.level] for reference in REFERENCES]
        if any(better >= worse for better, worse in pairwise(errors)):
            told = ", ".join(f"{error:.3f}" for error in errors)
            raise ConductError(
                f"the felt errors of the references do not rise: {told} JND; "
                "use a file whose operator touches something, or longer trials"
            )


def level_of(error: float, anchors: Sequence[tuple[float, int]]) -> float:
    """The level of a felt error, monotone in it, within the scale.

    Args:
        error: RMS felt error [JND].
        anchors: felt error and level of each reference, by rising error and falling level.
    """
    for (least, best), (most, worst) in pairwise(anchors):
        level = best + (worst - best) * (error - least) / (most - least)
        if error <= most:
            break
    return min(float(HIGHEST), max(float(LOWEST), level))
