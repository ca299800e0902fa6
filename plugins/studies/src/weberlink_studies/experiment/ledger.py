"""The ledger of one subject: an append-only file of JSON lines that survives a crash at any moment.

The first line is the plan, each further one an entry. A line is one write and is on the disk before the next event, so
that only the line being written can be lost. A torn last line is moved to a file beside the ledger.
"""

import fcntl
import os
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from errno import ENOSPC
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, NonNegativeInt, PositiveInt, TypeAdapter, ValidationError

from weberlink_studies.experiment.plan import REFERENCES, Level, TrialPlan


class LedgerError(Exception):
    """A ledger cannot be used; the text is one line with its path."""


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, strict=True)

    event: str
    at: str = Field(default_factory=lambda: datetime.now(UTC).isoformat(timespec="seconds"))
    simulated: bool = False


class _Felt(_Entry):
    figures: dict[str, Any] = Field(default_factory=dict)
    recording: str | None = None


class ReferenceFelt(_Felt):
    event: Literal["reference"] = "reference"
    reference: NonNegativeInt = Field(lt=len(REFERENCES))
    level: Level


class TrainingDone(_Entry):
    event: Literal["training_done"] = "training_done"


class TrialBegun(_Entry):
    event: Literal["trial_begun"] = "trial_begun"
    trial: PositiveInt


class TrialFailed(_Felt):
    """The trial must be repeated."""

    event: Literal["trial_failed"] = "trial_failed"
    trial: PositiveInt
    attempt: PositiveInt = 1
    problem: str


class TrialRated(_Felt):
    event: Literal["trial_rated"] = "trial_rated"
    trial: PositiveInt
    attempt: PositiveInt = 1
    rating: Level
    predictor: str
    weber: float


class BreakTaken(_Entry):
    event: Literal["break"] = "break"
    after: PositiveInt


class Resumed(_Entry):
    event: Literal["resumed"] = "resumed"
    environment: dict[str, Any] = Field(default_factory=dict)


Entry = ReferenceFelt | TrainingDone | TrialBegun | TrialFailed | TrialRated | BreakTaken | Resumed
_ENTRY: TypeAdapter[Entry] = TypeAdapter(Annotated[Entry, Field(discriminator="event")])


@dataclass
class SubjectProgress:
    """The state of a subject's experiment."""

    plan: TrialPlan  # of the experiment
    # figures of the references of the training, by their index
    references: dict[int, dict[str, Any]] = field(default_factory=dict)
    trained: bool = False  # whether the training is done
    begun: Counter[int] = field(default_factory=Counter)  # how often each trial was begun, by its number from 1
    rated: dict[int, TrialRated] = field(default_factory=dict)  # the entry of each rated trial, by its number
    breaks: set[int] = field(default_factory=set)  # numbers of the trials after which there was a break

    @property
    def remaining(self) -> list[int]:
        """Numbers of the trials that are not rated."""
        return [number for number in range(1, len(self.plan.trials) + 1) if number not in self.rated]

    def take(self, entry: Entry) -> None:
        """Apply an entry."""
        trials = self.plan.trials
        if isinstance(entry, TrialBegun | TrialFailed | TrialRated) and entry.trial > len(trials):
            raise ValueError(f"trial: expected 1 to {len(trials)}, not {entry.trial}")
        match entry:
            case ReferenceFelt():
                self.references[entry.reference] = entry.figures
            case TrainingDone():
                self.trained = True
            case TrialBegun():
                self.begun[entry.trial] += 1
            case BreakTaken():
                self.breaks.add(entry.after)
            case TrialRated(trial=number):
                if number in self.rated:
                    raise ValueError(f"trial {number} is rated twice")
                if (entry.predictor, entry.weber) != (trials[number - 1].predictor, trials[number - 1].weber):
                    raise ValueError(f"trial {number} has another condition than in the plan")
                self.rated[number] = entry


@dataclass
class Ledger:
    """A ledger that this process has locked; see `opened`."""

    path: Path  # of the file
    descriptor: int
    progress: SubjectProgress | None = None  # None while it has no plan
    set_aside: Path | None = None  # file with a torn last line, if there was one

    def append(self, line: TrialPlan | Entry) -> SubjectProgress:
        """Write the plan into an empty ledger, or an entry into another one; it is on the disk then.

        Raises:
            OSError: if it cannot be written; the ledger stays unchanged.
        """
        if self.progress is not None:
            line = line.model_copy(update={"simulated": self.progress.plan.simulated})
        data = line.model_dump_json(exclude_none=True).encode() + b"\n"
        end = os.fstat(self.descriptor).st_size
        try:
            written = os.write(self.descriptor, data)
            os.fsync(self.descriptor)
        except OSError:
            os.ftruncate(self.descriptor, end)
            raise
        if written != len(data):
            os.ftruncate(self.descriptor, end)
            raise OSError(ENOSPC, os.strerror(ENOSPC), str(self.path))
        if isinstance(line, TrialPlan):
            _sync_folder(self.path.parent)
            self.progress = SubjectProgress(line)
        else:
            assert self.progress is not None
            self.progress.take(line)
        return self.progress


@contextmanager
def opened(path: Path) -> Iterator[Ledger]:
    """Lock and read a ledger, which need not exist."""
    descriptor = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o644)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise LedgerError(f"{path}: another process runs an experiment with this subject") from None
        data = path.read_bytes()
        ledger = Ledger(path, descriptor, _parse(data, path))
        whole = data.rfind(b"\n") + 1
        if whole < len(data):
            ledger.set_aside = path.with_name(f"{path.name}.torn")
            with ledger.set_aside.open("ab") as file:  # on the disk before the ledger is truncated
                file.write(data[whole:] + b"\n")
                file.flush()
                os.fsync(file.fileno())
            _sync_folder(path.parent)
            os.ftruncate(descriptor, whole)
            os.fsync(descriptor)
        yield ledger
    finally:
        os.close(descriptor)


def read(path: Path) -> SubjectProgress | None:
    """Read a ledger without changing it; a torn last line is ignored. None if it has no plan."""
    try:
        return _parse(path.read_bytes(), path)
    except OSError as error:
        raise LedgerError(f"{path}: cannot be read: {error.strerror}") from None


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _parse(data: bytes, path: Path) -> SubjectProgress | None:
    progress: SubjectProgress | None = None
    for number, line in enumerate(data.split(b"\n")[:-1], 1):
        try:
            if progress is None:
                progress = SubjectProgress(TrialPlan.model_validate_json(line))
            else:
                progress.take(_ENTRY.validate_json(line))
        except ValueError as error:
            told = str(error)
            if isinstance(error, ValidationError):
                first = error.errors(include_url=False)[0]
                told = ": ".join((*(str(part) for part in first["loc"][-1:]), " ".join(first["msg"].split())))
            advice = "repair or remove the line by hand, or leave this subject out"
            raise LedgerError(f"{path}:{number}: damaged: {told}; {advice}") from None
    return progress


def path_of(folder: Path, subject: int, *, simulated: bool) -> Path:
    """Path of a subject's ledger."""
    return folder / f"{'simulated' if simulated else 'subject'}-{subject:03d}.jsonl"


def subjects(folder: Path, *, simulated: bool) -> list[int]:
    """Numbers of the subjects that have a ledger in a folder, in order."""
    prefix = "simulated-" if simulated else "subject-"
    names = [path.stem.removeprefix(prefix) for path in folder.glob(f"{prefix}*.jsonl")]
    return sorted(int(name) for name in names if name.isascii() and name.isdigit())
