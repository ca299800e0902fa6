"""A person at a terminal: what they read, and what they may answer. Tells them time and nothing else of a signal."""

import termios
from collections.abc import Mapping
from contextlib import suppress
from textwrap import wrap
from typing import TextIO

from weberlink.studies.experiment.conduct import Felt, Left
from weberlink.studies.experiment.ledger import Progress
from weberlink.studies.experiment.plan import BREAK_EVERY, Plan
from weberlink.studies.experiment.scale import HIGHEST, LOWEST, REFERENCES, Reference, rating_of

WIDTH = 78
BAR = 40
GUIDE = (
    "You move the device in your hand and feel a remote scene. The signal that you feel may be changed, in different "
    "ways and more or less strongly. After each trial, say on this scale what it was like:"
)
TRAINING = (
    "First come {references} references, which show you the scale; feel each as often as you like. Then come "
    "{trials} trials of {seconds:g} s, with a break after every {every}. Each is felt once and rated once. Ctrl-C "
    "leaves; you can go on later."
)
RATING_S = 8.0
"""Guess of what lies between two trials, for the time that is announced [s]."""


class Person:
    """Asks and tells through two streams, which may be a terminal or anything else.

    Args:
        source: what they type.
        screen: what they see.
        plan: with the wording that they read and the length of a trial.
    """

    def __init__(self, source: TextIO, screen: TextIO, plan: Plan) -> None:
        self._source = source
        self._screen = screen
        self._duration_s = plan.duration_s
        self._wording: Mapping[str, str] = plan.wording
        self._bar_is_shown = False

    def welcome(self, progress: Progress) -> None:
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

    def prepare_reference(self, place: int, reference: Reference) -> None:
        self._tell(
            f"Reference {place + 1} of {len(REFERENCES)}: this is level {reference.level}, "
            f"{self._wording[str(reference.level)]}."
        )
        self._ask("Take the device in your hand, then Enter to start: ")

    def learn(self, reference: Reference, felt: Felt) -> bool:  # noqa: ARG002
        self._clear()
        while (answer := self._ask("Enter to go on, r to feel it again: ").lower()) not in ("", "r"):
            self._tell("Please press Enter alone, or r and Enter.")
        self._tell("")
        return answer == "r"

    def prepare(self, number: int, of: int) -> None:
        self._ask(f"Trial {number} of {of}. Enter to start: ")

    def elapsed(self, seconds: float) -> None:
        if not self._screen.isatty():
            return
        share = min(1.0, max(0.0, seconds / self._duration_s))
        filled = round(share * BAR)
        left = f"{max(0.0, self._duration_s - seconds):4.0f} s left" if seconds > 0.0 else "starting "
        self._screen.write(f"\r  [{'#' * filled}{'.' * (BAR - filled)}] {left} ")
        self._screen.flush()
        self._bar_is_shown = True

    def rate(self, number: int, felt: Felt) -> int:  # noqa: ARG002
        self._clear()
        self._tell(*self._scale())
        while (rating := rating_of(self._ask(f"Rating {LOWEST} to {HIGHEST}: "))) is None:
            self._tell(f"Please type one number from {LOWEST} to {HIGHEST}, and Enter.")
        self._tell("")
        return rating

    def repeat(self, what: str, problem: str) -> None:
        self._clear()
        self._tell(f"This {what} does not count and comes again: {problem}")

    def rest(self, after: int, of: int) -> None:
        self._tell(f"{after} of {of} trials are done: a break. Let go of the device and rest your hand.")
        self._ask("When you are ready, Enter: ")
        self._tell("")

    def farewell(self) -> None:
        self._tell("That was the last trial. Thank you.")

    def leave(self) -> None:
        self._clear()

    def _scale(self) -> list[str]:
        levels = sorted(self._wording, key=int, reverse=True)
        return [f"  {level}  {self._wording[level]}" for level in levels]

    def _ask(self, prompt: str) -> str:
        """What is typed after the prompt was shown.

        Raises:
            Left: at the end of input or on Ctrl-C.
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
            raise Left
        return line.strip()

    def _forget_typed(self) -> None:
        """Drop what was typed before it was asked for: a key pressed during a trial is no rating."""
        if self._source.isatty():
            with suppress(termios.error, OSError):
                termios.tcflush(self._source.fileno(), termios.TCIFLUSH)

    def _clear(self) -> None:
        """Take the bar off the screen."""
        if self._bar_is_shown:
            self._screen.write("\r" + " " * WIDTH + "\r")
            self._bar_is_shown = False

    def _tell(self, *lines: str) -> None:
        self._screen.write("".join(f"{line}\n" for line in lines))
        self._screen.flush()
