"""What writes and reads recordings: formats of other distributions, named by the suffix of their files."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from weberlink.installation import absence
from weberlink.registry import Registry, check_contract

COMPLETE = "complete"  # the outcome of a recording that nothing has cut short


class Recorder(Protocol):
    """A process that records a running session, which never waits for it."""

    @property
    def path(self) -> Path: ...

    @property
    def running(self) -> bool:
        """Whether the process runs; it ends early if it was killed or could not write."""

    def mark(self, text: str) -> str:
        """Set a mark at this moment, without effect if the process has ended; returns its text in one line."""

    def stop(self) -> None:
        """Tell it to finish the file; `running` then becomes false."""

    def kill(self) -> None:
        """End it at once, if it does not finish; what it has written stays readable."""

    def finish(self) -> dict[str, Any]:
        """Wait for a limited time until the file is complete.

        Returns `path`, `bytes` and `outcome`; `records` and `lost` by side if the process could tell.
        """


class VirtualRecording(Protocol):
    """A recording of a session in virtual time, which this process writes."""

    def add(self, master: NDArray[np.void], slave: NDArray[np.void]) -> None:
        """Write the next records of both sides. A full disk ends the recording alone, and is told."""

    def finish(self) -> dict[str, Any]:
        """End the file; returns what `Recorder.finish` does."""


class Recording(Protocol):
    """What a file holds: facts about the system, records by side, oldest first, with the fields of this release as far
    as they are there, and the axes of a session in joint space (none of a hand).
    """

    @property
    def facts(self) -> Mapping[str, str]: ...

    @property
    def records(self) -> Mapping[str, NDArray[np.void]]: ...

    @property
    def joints(self) -> tuple[str, ...]: ...


class RecordingFormat(Protocol):
    """Starts recorders, writes and reads files; an entry of `RECORDERS`."""

    @staticmethod
    def start(
        described: Mapping[str, Any], rings: Mapping[str, str], out: Path, *, since: float | None = None
    ) -> Recorder:
        """Record a running session to a file.

        Args:
            described: the session, as of `weberlink.session.description` or `weberlink.session.recorder`.
            rings: path of each side's ring; they need not exist yet.
            since: moment on the clock of the records from which on to record [s]; None for all that the rings hold.
        """

    @staticmethod
    def create(path: Path, described: Mapping[str, Any], tell: Callable[[str], None]) -> VirtualRecording:
        """Begin a recording of both sides on a clock that starts at 0. Raises OSError if it cannot be made."""

    @staticmethod
    def read(path: Path) -> Recording:
        """Raises ValueError for a file that is no such recording; one line with its path."""


RECORDERS: Registry[RecordingFormat] = Registry(
    "recorder",
    {},
    "weberlink.recorders",
    lambda name, entry: check_contract(f"recorder {name}", entry, RecordingFormat),
)


def format_of(path: Path, asked: str) -> RecordingFormat:
    """The format of a file by its suffix; for one without a known suffix, the first that is installed. Raises
    ValueError if none is, whose message begins with `asked` and names one to install; PartError if it cannot be
    imported."""
    suffix = path.suffix[1:]
    name = suffix if suffix in RECORDERS else next(iter(RECORDERS), None)
    if name is None:
        absent = RECORDERS.absent()
        raise ValueError(absence(asked, absent.get(suffix) or next(iter(absent.values()))))
    return RECORDERS[name]
