"""Plans, and fakes of the trial runner and of the subject."""

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from weberlink_studies.experiment.conduct import (
    AGAIN,
    Conduct,
    Elapsed,
    FeltTrial,
    Prompt,
    SubjectLeft,
    TrialResult,
    TrialRunner,
)
from weberlink_studies.experiment.ledger import SubjectProgress, opened
from weberlink_studies.experiment.plan import SCALE, TrialPlan, order


def plan(subject: int = 1, *, simulated: bool = False, seed: int = 0, **changes: Any) -> TrialPlan:
    return TrialPlan(
        **{
            "subject": subject,
            "simulated": simulated,
            "seed": seed,
            "duration_s": 10.0,
            "digest": "d" * 64,
            "configuration": {"rate_hz": 1000.0},
            "wording": SCALE,
            "trials": order(seed, subject),
            "environment": {"machine": "none"},
        }
        | changes
    )


class Rig:
    """Notes what was felt; `problems` come up one after the other, None for a good trial."""

    def __init__(self, problems: Sequence[str | None] = ()) -> None:
        self.felt: list[FeltTrial] = []
        self._problems = list(problems)

    def feel(self, trial: FeltTrial, recording: Path | None, elapsed: Elapsed) -> TrialResult:
        self.felt.append(trial)
        if recording is not None:
            recording.touch(exist_ok=False)
        elapsed(0.5)
        problem = self._problems.pop(0) if self._problems else None
        figures = {"packets_per_s": 1000.0 / (1 + 100 * trial.condition.weber), "outcome": problem or "completed"}
        return TrialResult(figures, problem, problem == "interrupted")


class Robot:
    """A subject who rates by a rule, feels the second reference twice, and leaves when asked to start a trial."""

    def __init__(self, rule: Callable[[int], int] = lambda number: number % 6, leave_at: int = 99) -> None:
        self.said: list[str] = []
        self._rule = rule
        self._leave_at = leave_at

    def answer(self, prompt: Prompt) -> str:
        shown = " ".join((*prompt.text, prompt.question))
        found = re.search(r"Trial (\d+) of|Reference (\d)|(\d+) of 30 trials are done|repeated: (.*) $|Thank", shown)
        if prompt.rated is not None:
            return str(self._rule(prompt.rated))
        if found is not None and found[1] and int(found[1]) >= self._leave_at:
            raise SubjectLeft
        if found is not None:
            name = ("trial", "reference", "rest", "again:")
            number = next((place for place, group in enumerate(found.groups()) if group), None)
            self.said.append("thanks" if number is None else f"{name[number]} {found[number + 1]}")
        twice = self.said[-1:] == ["reference 2"] and self.said.count("reference 2") == 1
        return AGAIN if AGAIN in prompt.answers and twice else ""

    def elapsed(self, seconds: float | None) -> None:
        pass


def conduct(
    path: Path,
    rig: TrialRunner | None = None,
    robot: Robot | None = None,
    recordings: Path | None = None,
    first: TrialPlan | None = None,
) -> SubjectProgress:
    """Begin or continue an experiment, to its end or until the subject leaves."""
    with opened(path) as ledger:
        progress = ledger.progress or ledger.append(first or plan())
        with suppress(SubjectLeft):
            Conduct(ledger, rig or Rig(), robot or Robot(), recordings).run()
    return progress
