"""Plans, and fakes of the trial runner and of the subject."""

from collections.abc import Callable, Sequence
from pathlib import Path

from weberlink.studies.experiment.conduct import Elapsed, FeltTrial, SubjectLeft, TrialResult
from weberlink.studies.experiment.ledger import SubjectProgress
from weberlink.studies.experiment.plan import SCALE, TrainingReference, TrialPlan, order


def plan(subject: int = 1, *, simulated: bool = False, seed: int = 0) -> TrialPlan:
    return TrialPlan(
        subject=subject,
        simulated=simulated,
        seed=seed,
        duration_s=10.0,
        digest="d" * 64,
        configuration={"rate_hz": 1000.0},
        wording={str(level): text for level, text in SCALE.items()},
        trials=order(seed, subject),
        environment={"machine": "none"},
    )


class Rig:
    """Notes what was felt; `problems` come up one after the other, None for a good trial."""

    def __init__(self, problems: Sequence[str | None] = ()) -> None:
        self.felt: list[FeltTrial] = []
        self.recordings: list[Path | None] = []
        self._problems = list(problems)

    def feel(self, trial: FeltTrial, recording: Path | None, elapsed: Elapsed) -> TrialResult:
        self.felt.append(trial)
        self.recordings.append(recording)
        if recording is not None:
            with recording.open("xb"):
                pass
        elapsed(0.5)
        problem = self._problems.pop(0) if self._problems else None
        figures = {"packets_per_s": 1000.0 / (1 + 100 * trial.condition.weber), "outcome": problem or "completed"}
        return TrialResult(figures, problem, problem == "interrupted")


class Robot:
    """A subject who rates by a rule, and leaves when asked for a trial beyond a number."""

    def __init__(self, rule: Callable[[int], int] = lambda number: number % 6, leave_at: int = 99) -> None:
        self.said: list[str] = []
        self._rule = rule
        self._leave_at = leave_at

    def welcome(self, progress: SubjectProgress) -> None:
        self.said.append(f"welcome {len(progress.rated)}")

    def prepare_reference(self, place: int, reference: TrainingReference) -> None:
        self.said.append(f"reference {reference.level}")

    def learn(self, reference: TrainingReference, felt: TrialResult) -> bool:
        return reference.level == 3 and self.said.count("reference 3") == 1

    def prepare(self, number: int, of: int) -> None:
        if number >= self._leave_at:
            raise SubjectLeft
        self.said.append(f"trial {number} of {of}")

    def elapsed(self, seconds: float) -> None:
        pass

    def rate(self, number: int, felt: TrialResult) -> int:
        return self._rule(number)

    def repeat(self, what: str, problem: str) -> None:
        self.said.append(f"{what} again: {problem}")

    def rest(self, after: int, of: int) -> None:
        self.said.append(f"rest {after}")

    def farewell(self) -> None:
        self.said.append("farewell")

    def leave(self) -> None:
        self.said.append("leave")
