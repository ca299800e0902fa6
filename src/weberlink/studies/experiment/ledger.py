"""The ledger of one subject: an append-only file of JSON lines that survives a crash at any moment.

The first line is the plan, each further one an event. A line is one write and is on the disk before the next event, so
that only the line being written can be lost. A torn last line is moved to a file beside the ledger.
"""

import fcntl
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from errno import ENOSPC
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from weberlink.studies.experiment.plan import HIGHEST, LOWEST, TrialPlan

PLAN = "plan"
REFERENCE = "reference"
"""A reference was felt in the training."""
TRAINED = "training_done"
BEGUN = "trial_begun"
FAILED = "trial_failed"
"""The trial must be repeated."""
RATED = "trial_rated"
BREAK = "break"
RESUMED = "resumed"
EVENTS = (REFERENCE, TRAINED, BEGUN, FAILED, RATED, BREAK, RESUMED)

Event = Mapping[str, Any]


class LedgerError(Exception):
    """A ledger cannot be used; the text is one line with its path."""


@dataclass
class SubjectProgress:
    """The state of a subject's experiment.

    Args:
        plan: of the experiment.
        references: figures of the references of the training, by their index.
        trained: whether the training is done.
        begun: how often each trial was begun, by its number from 1.
        rated: the event of each rated trial, by its number.
        breaks: numbers of the trials after which there was a break.
    """

    plan: TrialPlan
    references: dict[int, Mapping[str, Any]] = field(default_factory=dict)
    trained: bool = False
    begun: dict[int, int] = field(default_factory=dict)
    rated: dict[int, Event] = field(default_factory=dict)
    breaks: set[int] = field(default_factory=set)

    @property
    def remaining(self) -> list[int]:
        """Numbers of the trials that are not rated."""
        return [number for number in range(1, len(self.plan.trials) + 1) if number not in self.rated]

    @property
    def complete(self) -> bool:
        return not self.remaining

    def take(self, event: Event) -> None:
        """Apply an event.

        Raises:
            ValueError: if it does not fit the plan.
        """
        kind = event.get("event")
        if kind not in EVENTS:
            raise ValueError(f"expected an event, not {kind!r}")
        if kind == REFERENCE:
            self.references[_whole(event, "reference", 0, 99)] = dict(event.get("figures") or {})
        elif kind == TRAINED:
            self.trained = True
        elif kind == BEGUN:
            number = self._trial(event)
            self.begun[number] = self.begun.get(number, 0) + 1
        elif kind == RATED:
            self._rate(event)
        elif kind == BREAK:
            self.breaks.add(_whole(event, "after", 1, len(self.plan.trials)))

    def _rate(self, event: Event) -> None:
        number = self._trial(event)
        _whole(event, "rating", LOWEST, HIGHEST)
        if number in self.rated:
            raise ValueError(f"trial {number} is rated twice")
        planned = self.plan.trials[number - 1]
        if (event.get("predictor"), event.get("weber")) != (planned.predictor, planned.weber):
            raise ValueError(f"trial {number} has another condition than in the plan")
        self.rated[number] = event

    def _trial(self, event: Event) -> int:
        return _whole(event, "trial", 1, len(self.plan.trials))


def _whole(event: Event, name: str, low: int, high: int) -> int:
    value = event.get(name)
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise ValueError(f"{name}: expected {low} to {high}, not {value!r}")
    return value


def read(path: Path) -> SubjectProgress | None:
    """Read a ledger without changing it; a torn last line is ignored.

    Returns:
        None if it has no plan.

    Raises:
        LedgerError: if it is damaged or cannot be read.
    """
    try:
        whole, _ = _split(path.read_bytes())
    except OSError as error:
        raise LedgerError(f"{path}: cannot be read: {error.strerror}") from None
    return _parse(whole, path)


class Ledger:
    """A ledger locked by this process. A context manager, which releases the lock.

    Raises:
        LedgerError: if another process has locked it, or it is damaged.
        FileExistsError: if `new` and the file exists.
        OSError: if it cannot be written.
    """

    def __init__(self, path: Path, *, new: bool = False) -> None:
        self.path = path
        self.set_aside: Path | None = None
        """File with a torn last line, if there was one."""
        self._descriptor = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT | (os.O_EXCL if new else 0), 0o644)
        try:
            self._lock()
            self.progress = self._recover()
        except BaseException:
            os.close(self._descriptor)
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        os.close(self._descriptor)

    def begin(self, plan: TrialPlan) -> SubjectProgress:
        """Write the plan into an empty ledger.

        Raises:
            OSError: if it cannot be written; the ledger stays empty.
        """
        assert self.progress is None
        self._write({"event": PLAN} | plan.as_json())
        _sync_folder(self.path.parent)
        self.progress = SubjectProgress(plan)
        return self.progress

    def append(self, event: str, **facts: Any) -> None:
        """Write an event to the disk.

        Raises:
            OSError: if it cannot be written; the ledger stays unchanged.
        """
        assert self.progress is not None
        line = {"event": event, "at": datetime.now(UTC).isoformat(timespec="seconds")} | facts
        if self.progress.plan.simulated:
            line["simulated"] = True
        self._write(line)
        self.progress.take(line)

    def _lock(self) -> None:
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise LedgerError(f"{self.path}: another process runs an experiment with this subject") from None

    def _recover(self) -> SubjectProgress | None:
        data = self.path.read_bytes()
        whole, torn = _split(data)
        progress = _parse(whole, self.path)
        if torn:
            self.set_aside = _put_aside(torn, self.path)
            os.ftruncate(self._descriptor, len(whole))
            os.fsync(self._descriptor)
        return progress

    def _write(self, line: Mapping[str, Any]) -> None:
        data = json.dumps(line, allow_nan=False).encode() + b"\n"
        end = os.fstat(self._descriptor).st_size
        try:
            written = os.write(self._descriptor, data)
            os.fsync(self._descriptor)
        except OSError:
            os.ftruncate(self._descriptor, end)
            raise
        if written != len(data):
            os.ftruncate(self._descriptor, end)
            raise OSError(ENOSPC, os.strerror(ENOSPC), str(self.path))


def _split(data: bytes) -> tuple[bytes, bytes]:
    """Complete lines, and the torn rest."""
    end = data.rfind(b"\n") + 1
    return data[:end], data[end:]


def _put_aside(torn: bytes, path: Path) -> Path:
    """Write a torn line to a new file beside the ledger, synced before the ledger is truncated."""
    number = 1
    while (aside := path.with_name(f"{path.name}.torn-{number}")).exists():
        number += 1
    with aside.open("xb") as file:
        file.write(torn)
        file.flush()
        os.fsync(file.fileno())
    _sync_folder(path.parent)
    return aside


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _parse(whole: bytes, path: Path) -> SubjectProgress | None:
    progress: SubjectProgress | None = None
    for number, line in enumerate(whole.split(b"\n")[:-1], 1):
        try:
            event = _object(line)
            if progress is None:
                progress = SubjectProgress(TrialPlan.from_json(event))
            else:
                progress.take(event)
        except ValueError as error:
            raise LedgerError(
                f"{path}:{number}: damaged: {error}; repair or remove the line by hand, or leave this subject out"
            ) from None
    return progress


def _object(line: bytes) -> dict[str, Any]:
    try:
        value = json.loads(line)
    except ValueError:
        raise ValueError("not JSON") from None
    if not isinstance(value, dict):
        raise ValueError("expected a JSON object")  # noqa: TRY004 - an error of the file
    return value


def path_of(folder: Path, subject: int, *, simulated: bool) -> Path:
    """Path of a subject's ledger."""
    return folder / f"{'simulated' if simulated else 'subject'}-{subject:03d}.jsonl"


def subjects(folder: Path, *, simulated: bool) -> Sequence[int]:
    """Numbers of the subjects that have a ledger in a folder, in order."""
    prefix = "simulated-" if simulated else "subject-"
    names = [path.stem.removeprefix(prefix) for path in folder.glob(f"{prefix}*.jsonl")]
    return sorted(int(name) for name in names if name.isascii() and name.isdigit())
