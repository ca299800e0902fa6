"""Angles for the `remote_leader` arm from another process of the same user: one target in shared memory.

The daemon of the master makes a file of mode 0600 in the runtime directory, which no other user can enter. One process
at a time leads: it holds a lock on the file, which the kernel removes with the process. The target is a
`weberlink.hardware.slot`, so one that is only partly written is recognised and read in the next tick.
"""

import fcntl
import os
import stat
from mmap import MAP_SHARED, mmap
from pathlib import Path
from struct import Struct
from tempfile import mkstemp
from typing import NamedTuple, Protocol, Self

from weberlink.geometry.joints import MOST_JOINTS, Joints, is_finite
from weberlink.hardware.slot import Slot, size_of
from weberlink.telemetry.runtime_directory import ForeignFileError, check, directories, directory

MOST_AXES = MOST_JOINTS + 1
HEADER = Struct("<4sI")
"""Mark, number of axes."""
MARK = b"WLA1"
TARGET_AT = 8
TARGET = Struct(f"<Q{MOST_AXES}d")
"""1 while it leads, angles [rad]; unused ones are 0."""
SIZE = TARGET_AT + size_of(TARGET)


class LeaderTarget(NamedTuple):
    """Angles of all axes [rad], and whether the process that wrote them leads."""

    angles: Joints
    leads: bool


class TargetInUseError(RuntimeError):
    """Another process leads the arm."""


def target_path(pid: int) -> Path:
    """Where the daemon with this process id has its target: the file if it is there, else where it would be.

    Raises:
        RuntimeDirectoryError: there is no place for it.
    """
    name = f"weberlink-{pid}.leader"
    found = (path for path in (folder / name for folder in directories()) if path.is_file())
    return next(found, None) or directory() / name


class LeaderTargets(Protocol):
    """Where a remote leader gets its targets."""

    def open(self, axes: int) -> None:
        """Begin; raises OSError if that is not possible."""

    def newest(self) -> LeaderTarget | None:
        """The newest target if it is another one than that of the last call, else None. Never waits, never raises."""

    def close(self) -> None:
        """End; may be repeated."""


class TargetMemory:
    """The daemon's end."""

    def __init__(self) -> None:
        self._map: mmap | None = None
        self._path: Path | None = None
        self._axes = 0

    def open(self, axes: int) -> None:
        """Make the file for a target of so many axes, in place of one that a killed process left.

        Raises:
            OSError: there is no place for it.
        """
        self.close()
        path = directory() / f"weberlink-{os.getpid()}.leader"
        fd, draft = mkstemp(prefix=f"{path.name}.", dir=path.parent)
        try:
            os.posix_fallocate(fd, 0, SIZE)
            mapping = mmap(fd, SIZE, flags=MAP_SHARED)
            mapping[: HEADER.size] = HEADER.pack(MARK, axes)
            Path(draft).replace(path)
        except BaseException:
            Path(draft).unlink()
            raise
        finally:
            os.close(fd)
        self._map, self._path, self._axes = mapping, path, axes
        self._slot = Slot(mapping, TARGET_AT, TARGET)

    def newest(self) -> LeaderTarget | None:
        values = None if self._map is None else self._slot.newest()
        if values is None:
            return None
        leads, *angles = values
        target = tuple(angles[: self._axes])
        return LeaderTarget(target, bool(leads)) if is_finite(target) else None

    def close(self) -> None:
        """Remove the file; may be repeated."""
        if self._map is None or self._path is None:
            return
        self._map.close()
        self._map = None
        self._path.unlink(missing_ok=True)


class TargetWriter:
    """The other end: leads the arm of the daemon with a process id, alone, until it is closed.

    Raises:
        FileNotFoundError: there is no such daemon, or its arm is no `remote_leader`.
        TargetInUseError: another process leads it.
        ForeignFileError: the file is another user's, or is no target.
        OSError: the file cannot be opened.
    """

    def __init__(self, pid: int) -> None:
        path = target_path(pid)
        self._fd = os.open(path, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            self._map = self._mapped(path)
        except BaseException:
            os.close(self._fd)
            raise
        self.axes: int = HEADER.unpack_from(self._map)[1]
        self._slot = Slot(self._map, TARGET_AT, TARGET)
        self._angles: Joints | None = None
        self._closed = False

    def _mapped(self, path: Path) -> mmap:
        status = os.fstat(self._fd)
        check(path, status, stat.S_IFREG)
        if status.st_size != SIZE or os.pread(self._fd, len(MARK), 0) != MARK:
            raise ForeignFileError(f"{path} is not the target of a remote leader of this release")
        try:
            fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise TargetInUseError(f"another process leads this arm already ({path}); end it first") from None
        return mmap(self._fd, SIZE, flags=MAP_SHARED)

    def write(self, angles: Joints) -> None:
        """Lead to these angles of all axes [rad]. Repeat it, at 30 Hz for example: a writer that is silent has let go.

        Raises:
            ValueError: an angle is not finite, or there are more or fewer than axes.
        """
        if len(angles) != self.axes or not is_finite(angles):
            raise ValueError(f"expected {self.axes} finite angles, not {angles}")
        self._angles = angles
        self._put(angles, leads=True)

    def close(self) -> None:
        """Let go, and let another process lead; may be repeated."""
        if self._closed:
            return
        self._closed = True
        if self._angles is not None:
            self._put(self._angles, leads=False)
        self._map.close()
        os.close(self._fd)

    def _put(self, angles: Joints, *, leads: bool) -> None:
        self._slot.write(leads, *angles, *(0.0,) * (MOST_AXES - len(angles)))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
