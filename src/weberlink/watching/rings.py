"""Finds the telemetry rings of this host and reads their records."""

import re
import stat
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from weberlink.system.configuration import SIDES
from weberlink.system.description import path_beside
from weberlink.system.description import read as read_description
from weberlink.system.scoring.session import Records
from weberlink.telemetry.reader import DTYPE, RingReader
from weberlink.telemetry.ring import RingFormatError
from weberlink.telemetry.runtime_directory import directories

_NAME = re.compile(rf"weberlink-(\d+)-({'|'.join(SIDES)})\.ring")


class RingFile(NamedTuple):
    """A ring file; `inode` tells it from an earlier file of the same name."""

    session: str
    side: str
    path: Path
    inode: int
    changed: float
    """Wall clock time of its last change of status [s]."""


def find_rings(where: Path | None) -> dict[str, dict[str, RingFile]]:
    """Rings by session and side, the newest session last; a session is named by its launcher's process id.

    Args:
        where: folder to search; None for the runtime directories of this user, where no other user can create files.
    """
    sessions: dict[str, dict[str, RingFile]] = {}
    for path in (path for folder in (directories() if where is None else [where]) for path in folder.glob("*.ring")):
        match = _NAME.fullmatch(path.name)
        if match is None:
            continue
        try:
            status = path.lstat()
        except FileNotFoundError:
            continue
        if stat.S_ISREG(status.st_mode):
            session, side = match.groups()
            sessions.setdefault(session, {})[side] = RingFile(session, side, path, status.st_ino, status.st_ctime)
    return dict(sorted(sessions.items(), key=lambda item: min(ring.changed for ring in item[1].values())))


class Feed(Protocol):
    """The records of one side, oldest first, until it ends."""

    side: str
    rate_hz: float
    began: float
    """When its writer began, on the clock of its records [s]."""
    ring: Path
    """The ring that has them; beside it is the control socket of its writer."""
    wall_offset_s: float
    """From the clock of the records to the wall clock [s]."""
    in_order: bool
    """Whether its writer ended in order; False while it runs."""

    @property
    def description(self) -> dict[str, Any] | None:
        """See `weberlink.system.description`; None if unknown. Another object when there is news."""

    @property
    def written(self) -> int:
        """Number of records written so far."""

    @property
    def lost(self) -> int:
        """Number of records that were overwritten before they were read."""

    @property
    def drained(self) -> bool:
        """Whether the writer has ended and all its records were read; changed by `read` only."""

    def read(self) -> Records:
        """The records since the last call."""

    def close(self) -> None: ...


class RingFeed:
    """Feed of a ring on this host.

    Raises:
        FileNotFoundError: the ring is gone.
        RingFormatError: it is not a ring of this release.
    """

    def __init__(self, path: Path) -> None:
        self._reader = RingReader(path)
        self.side = self._reader.side
        self.rate_hz = self._reader.rate_hz
        self.began = self._reader.started_monotonic_s
        self.description: dict[str, Any] | None = None
        self._described_by: tuple[int, int] | None = None
        self.ring = path
        self._look_at_description()
        self.wall_offset_s = self._reader.started_wall_s - self.began
        self.in_order = False
        self.drained = False
        self.written = 0
        self.lost = 0
        self._read = 0

    @property
    def alive(self) -> bool:
        """Whether its writer still writes."""
        return self._reader.alive

    def read(self) -> Records:
        if self.drained:
            return self._reader.read()[:0]
        alive = self._reader.alive  # before the read, which then takes all of it
        records, self.written = self._reader.read(), self._reader.passed
        self._read += len(records)
        # The ring does not count what it lost before it was opened.
        self.lost = max(self.lost, self._reader.overrun, self.written - self._read)
        self.drained = not alive
        if self.drained:
            self.in_order = self._reader.ended_in_order
        else:
            self._look_at_description()
        return records

    def _look_at_description(self) -> None:
        """Read the description if its file was replaced; once it is gone, the last one stays."""
        path = path_beside(self._reader.path)
        try:
            status = path.lstat()
        except OSError:
            return
        replaced = status.st_ino, status.st_mtime_ns
        if replaced != self._described_by:
            self._described_by = replaced
            self.description = read_description(self._reader.path) or self.description

    def close(self) -> None:
        self._reader.close()


class RingOpener:
    """Opens every ring of a living writer once.

    Args:
        tell: called with the reason if a file is no ring of this release.
    """

    def __init__(self, tell: Callable[[str], None] = lambda _: None) -> None:
        self._tell = tell
        self._known: set[tuple[str, int]] = set()

    def open(self, ring: RingFile) -> RingFeed | None:
        key = (str(ring.path), ring.inode)
        if key in self._known:
            return None
        self._known.add(key)
        try:
            feed = RingFeed(ring.path)
        except FileNotFoundError:
            return None
        except (RingFormatError, OSError) as error:
            self._tell(f"ignored: {error}")
            return None
        if feed.alive:
            return feed
        feed.close()
        return None


def joined(pieces: Iterable[Records]) -> Records:
    """Concatenate records into one read-only array.

    Via bytes: `np.concatenate` first finds the common type of forty fields, which takes thirty times as long.
    """
    return np.frombuffer(b"".join([piece.tobytes() for piece in pieces]), DTYPE)
