"""Finds the telemetry rings of this host and reads their records."""

import re
import stat
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import Any, NamedTuple

from weberlink.config import SIDES
from weberlink.session.description import path_beside, read as read_description
from weberlink.telemetry.reader import Records, RingReader
from weberlink.telemetry.ring import RingFormatError
from weberlink.telemetry.runtime_directory import directories

_NAME = re.compile(rf"weberlink-(\d+)-({'|'.join(SIDES)})\.ring")


class RingFile(NamedTuple):
    """A ring file; `inode` tells it from an earlier file of the same name."""

    session: str
    side: str
    path: Path
    inode: int
    changed: float  # wall clock time of its last change of status [s]


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
        with suppress(FileNotFoundError):
            status, (session, side) = path.lstat(), match.groups()
            if stat.S_ISREG(status.st_mode):
                sessions.setdefault(session, {})[side] = RingFile(session, side, path, status.st_ino, status.st_ctime)
    return dict(sorted(sessions.items(), key=lambda item: min(ring.changed for ring in item[1].values())))


class NoSessionError(RuntimeError):
    """There is no such end of a live session, or more than one; the message says what to do."""


def living_ring(side: str, session: str | None = None, where: Path | None = None) -> RingFile:
    """The ring of the one end of a live session on this host.

    Args:
        side: master or slave.
        session: process id of its launcher; None for the only one.
        where: as of `find_rings`.

    Raises:
        NoSessionError: there is none, or more than one and no session given.
    """
    living = list[RingFile]()
    for ring in (ends[side] for ends in find_rings(where).values() if side in ends):
        if session in (None, ring.session):
            with suppress(RingFormatError, OSError), closing(RingReader(ring.path)) as reader:
                living += [ring] if reader.alive else []
    if len(living) > 1:
        names = ", ".join(ring.session for ring in living)
        raise NoSessionError(f"{len(living)} sessions have a {side} on this host; choose by session one of {names}")
    if not living:
        which = "" if session is None else f" of session {session}"
        raise NoSessionError(f"no {side}{which} runs on this host; start one, for example: weberlink loopback FILE")
    return living[0]


class RingSource:
    """The records of one side, oldest first, until it ends, from its ring on this host.

    Attributes:
        side, rate_hz, ring: of the writer; beside the ring is its control socket.
        began: when it began, on the clock of its records [s].
        wall_offset_s: from the clock of the records to the wall clock [s].
        description: see `weberlink.session.description`; None if unknown. Another object when there is news.
        written: number of records written so far.
        lost: number of records that were overwritten before they were read.
        drained: whether the writer has ended and all its records were read; changed by `read` only.
        in_order: whether its writer ended in order; False while it runs.

    Raises:
        FileNotFoundError: the ring is gone.
        RingFormatError: it is not a ring of this release.
    """

    def __init__(self, path: Path) -> None:
        self._reader = reader = RingReader(path)
        self.side, self.rate_hz, self.ring = reader.side, reader.rate_hz, path
        self.began = reader.started_monotonic_s
        self.wall_offset_s = reader.started_wall_s - self.began
        self.description: dict[str, Any] | None = None
        self.in_order = self.drained = False
        self.written = self.lost = self._read = 0
        self._described_by: tuple[int, int] | None = None
        self._look_at_description()

    @property
    def alive(self) -> bool:
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
        with suppress(OSError):
            status = path_beside(self.ring).lstat()
            replaced = status.st_ino, status.st_mtime_ns
            if replaced != self._described_by:
                self._described_by = replaced
                self.description = read_description(self.ring) or self.description

    def close(self) -> None:
        self._reader.close()


class RingOpener:
    """Opens every ring of a living writer once. `tell`: called with the reason if a file is no ring of this release."""

    def __init__(self, tell: Callable[[str], None] = lambda _: None) -> None:
        self._tell = tell
        self._known: set[tuple[str, int]] = set()

    def open(self, ring: RingFile) -> RingSource | None:
        key = (str(ring.path), ring.inode)
        if key in self._known:
            return None
        self._known.add(key)
        try:
            source = RingSource(ring.path)
        except FileNotFoundError:
            return None
        except (RingFormatError, OSError) as error:
            self._tell(f"ignored: {error}")
            return None
        if source.alive:
            return source
        source.close()
        return None
