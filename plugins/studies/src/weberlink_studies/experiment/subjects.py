"""Subjects of an experiment: a person at a terminal, and a program that rates by a rule.

A person sees the elapsed time and nothing else of a signal. The program tests the study and its analysis; it is no
model of a person. It rates the RMS felt error in just noticeable differences (JND) on a scale that it learns in the
training: the references have the levels 5, 3 and 1; between them, and beyond the last, levels are linear in the error.
Noise, seeded per subject and trial, is added, and the result is rounded. Such ratings are marked as simulated.
"""

import termios
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import pairwise
from random import Random
from typing import TextIO

from weberlink_studies.experiment.conduct import WIDTH, ConductError, Prompt, SubjectLeft
from weberlink_studies.experiment.ledger import SubjectProgress
from weberlink_studies.experiment.plan import HIGHEST, LOWEST, REFERENCES

BAR = 40


class Person:
    """A person at two text streams, such as a terminal."""

    def __init__(self, source: TextIO, screen: TextIO, duration_s: float) -> None:
        self._source = source
        self._screen = screen
        self._duration_s = duration_s

    def answer(self, prompt: Prompt) -> str:
        self._write(*(f"{line}\n" for line in prompt.text))
        while prompt.question:
            typed = self._ask(prompt.question)
            if typed in prompt.answers:
                return typed
            self._write(f"{prompt.otherwise}\n")
        return ""

    def elapsed(self, seconds: float | None) -> None:
        """Show a bar over the time, and remove it at the end."""
        if not self._screen.isatty():
            return
        if seconds is None:
            self._write("\r" + " " * WIDTH + "\r")
            return
        filled = round(min(1.0, max(0.0, seconds / self._duration_s)) * BAR)
        left = f"{max(0.0, self._duration_s - seconds):4.0f} s left" if seconds > 0.0 else "starting "
        self._write(f"\r  [{'#' * filled}{'.' * (BAR - filled)}] {left} ")

    def _ask(self, question: str) -> str:
        """A line of input, in small letters. Its end and Ctrl-C raise `SubjectLeft`."""
        if self._source.isatty():
            with suppress(termios.error, OSError):  # a key pressed during a trial is no rating
                termios.tcflush(self._source.fileno(), termios.TCIFLUSH)
        self._write(question)
        try:
            line = self._source.readline()
        except KeyboardInterrupt:
            line = ""
        if not line:
            self._write("\n")
            raise SubjectLeft
        return line.strip().lower()

    def _write(self, *texts: str) -> None:
        self._screen.write("".join(texts))
        self._screen.flush()


FELT = "error_rms_jnd"  # the figure that is rated
SPREAD = 0.5  # standard deviation of the noise on a level before rounding


class SimulatedSubject:
    """A program that rates by the rule above."""

    def __init__(self, progress: SubjectProgress, report: Callable[[int, int], None]) -> None:
        self._progress = progress
        self._report = report

    def answer(self, prompt: Prompt) -> str:
        """The level of the felt error plus noise, rounded."""
        plan = self._progress.plan
        self._report(len(self._progress.rated), len(plan.trials))
        if prompt.felt is not None and prompt.felt.problem is not None:
            raise ConductError(f"a simulated trial cannot be rated: {prompt.felt.problem}")
        if prompt.felt is None or prompt.rated is None:
            return ""
        chance = Random(f"{plan.seed}/{plan.subject}/rating/{prompt.rated}")  # noqa: S311 - must be repeatable
        level = level_of(float(prompt.felt.figures[FELT]), self._anchors()) + chance.gauss(0.0, SPREAD)
        return str(min(HIGHEST, max(LOWEST, round(level))))

    def elapsed(self, seconds: float | None) -> None:
        pass

    def _anchors(self) -> list[tuple[float, int]]:
        """Felt error and level of each reference."""
        felt = [self._progress.references[place] for place in range(len(REFERENCES))]
        if any(FELT not in figures for figures in felt):
            raise ConductError(f"the training has no {FELT}: it is of an earlier release; begin another subject")
        errors = [float(figures[FELT]) for figures in felt]
        if any(better >= worse for better, worse in pairwise(errors)):
            told = ", ".join(f"{error:.3f}" for error in errors)
            raise ConductError(
                f"the felt errors of the references do not rise: {told} JND; "
                "use a file whose operator touches something, or longer trials"
            )
        return [(error, reference.level) for error, reference in zip(errors, REFERENCES, strict=True)]


def level_of(error: float, anchors: Sequence[tuple[float, int]]) -> float:
    """The level of a felt error, monotone in it, within the scale."""
    for (least, best), (most, worst) in pairwise(anchors):
        level = best + (worst - best) * (error - least) / (most - least)
        if error <= most:
            break
    return min(float(HIGHEST), max(float(LOWEST), level))
