"""Targets from another process of the same user, for a device or an arm that a program leads.

The daemon of the master makes a file of mode 0600 in the runtime directory, which no other user can enter. For
`pointer` it is an AF_UNIX socket: a datagram is complete in itself, so a lost one costs nothing once the next has
arrived. For `remote_leader` it is shared memory with one target, a `weberlink.slot`, so one that is only
partly written is recognised and read in the next tick. One process at a time leads an arm: it holds a lock on the file,
which the kernel removes with the process.
"""

import fcntl
import os
import select
import socket
import stat
from contextlib import suppress
from math import isfinite, tau
from mmap import MAP_SHARED, mmap
from pathlib import Path
from struct import Struct
from struct import error as StructError  # noqa: N812 - as of an exception
from tempfile import mkstemp
from time import monotonic_ns
from typing import NamedTuple, Protocol, Self, TypeVar

from weberlink.geometry import joints
from weberlink.geometry.joints import MOST_JOINTS, Joints
from weberlink.geometry.vector import ZERO, Vector, is_finite, norm
from weberlink.slot import Slot, size_of
from weberlink.telemetry.runtime_directory import ForeignFileError, check, directories, directory, listening_socket

POINTER, LEADER = "pointer", "leader"

Target_co = TypeVar("Target_co", covariant=True)


class TargetSource(Protocol[Target_co]):
    """Where a device or an arm gets its targets."""

    def open(self) -> None:
        """Begin; raises OSError if that is not possible."""

    def newest(self) -> Target_co | None:
        """The newest target that arrived since the last call; None if none did. Never waits, never raises."""

    def close(self) -> None:
        """End; may be repeated."""


def link_path(pid: int, kind: str) -> Path:
    """Where the daemon with this process id has its `POINTER` or `LEADER`: the file if it is there, else its place.

    Raises:
        RuntimeDirectoryError: there is no place for it.
    """
    name = f"weberlink-{pid}.{kind}"
    found = (path for path in (folder / name for folder in directories()) if path.is_socket() or path.is_file())
    return next(found, None) or directory() / name


# --- datagrams

LAYOUT = Struct("<4sQ?6d")
"""Mark, number, held, x, y, z [m], rotation vector [rad]."""
MARK = b"WLP2"
MOST_A_TICK = 16
"""Datagrams that one call of `TargetSocket.newest` reads; the kernel's queue holds 10 by default."""


class PointerTarget(NamedTuple):
    """Where the operator means the handle to be [m], and whether they hold it; the highest number is the newest.

    `rotation` is the rotation vector of how they mean to turn it [rad], at most one turn; a hand with a wrist follows.
    """

    target: Vector
    held: bool
    number: int
    rotation: Vector = ZERO


def pack(target: Vector, held: bool, number: int, rotation: Vector = ZERO) -> bytes:
    """The datagram of a target.

    Raises:
        ValueError: the target is not finite, its rotation is more than a turn, or the number is not one of 64 bits.
    """
    if not is_finite(target):
        raise ValueError(f"a target must be finite, not {target}")
    if not norm(rotation) <= tau:
        raise ValueError(f"a target must be turned by at most {tau} rad, not {rotation}")
    try:
        return LAYOUT.pack(MARK, number, held, *target, *rotation)
    except StructError as error:
        raise ValueError(f"not a target: {error}") from None


def unpack(data: bytes) -> PointerTarget:
    """The target in a datagram; raises ValueError if it is none."""
    if len(data) != LAYOUT.size:
        raise ValueError(f"a target has {LAYOUT.size} bytes, not {len(data)}")
    mark, number, held, x, y, z, *turn = LAYOUT.unpack(data)
    rotation = (turn[0], turn[1], turn[2])
    if mark != MARK or not (isfinite(x) and isfinite(y) and isfinite(z) and norm(rotation) <= tau):
        raise ValueError("not a target")
    return PointerTarget((x, y, z), held, number, rotation)


class TargetSocket:
    """The daemon's end: takes the newest of the targets that have arrived, and ignores all else."""

    def __init__(self) -> None:
        self._socket: socket.socket | None = None
        self._path = Path()
        self._number = -1

    def open(self) -> None:
        self.close()
        self._path = directory() / f"weberlink-{os.getpid()}.{POINTER}"
        listener = listening_socket(self._path)
        self._socket, self._number = listener, -1
        waiting = select.poll()
        waiting.register(listener.fileno(), select.POLLIN)
        self._waiting = waiting.poll

    def newest(self) -> PointerTarget | None:
        # To ask first costs a third of a read that finds nothing and raises an exception.
        if self._socket is None or not self._waiting(0):
            return None
        newest = None
        with suppress(OSError):  # no more are there
            for _ in range(MOST_A_TICK):
                with suppress(ValueError):  # ignored
                    arrived = unpack(self._socket.recv(LAYOUT.size + 1))
                    if arrived.number > self._number:
                        newest, self._number = arrived, arrived.number
        return newest

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None
            self._path.unlink(missing_ok=True)


class PointerSender:
    """The other end: sends targets to the daemon with a process id, which may begin later or end meanwhile.

    Its numbers are times, so those of a sender that replaces another one are newer.
    """

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self._socket: socket.socket | None = None
        self._number = 0

    def send(self, target: Vector, held: bool, rotation: Vector = ZERO) -> bool:
        """Send a target [m], turned by a rotation vector [rad]; repeat it at least every 33 ms while it is held.

        Returns:
            Whether the daemon has it to read; False if it is not there, or has not read those before.

        Raises:
            ValueError: the target is not finite, or is turned by more than a turn.
        """
        self._number = max(self._number + 1, monotonic_ns())
        data = pack(target, held, self._number, rotation)
        try:
            if self._socket is None:
                path = link_path(self._pid, POINTER)
                check(path, path.lstat(), stat.S_IFSOCK)
                self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
                self._socket.connect(str(path))
            self._socket.send(data)
        except BlockingIOError:  # its queue is full
            return False
        except OSError:  # among them a file of another user in its place
            self.close()
            return False
        return True

    def close(self) -> None:
        """Release the socket; may be repeated. Sends nothing: send `held` False before."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


# --- shared memory

MOST_AXES = MOST_JOINTS + 1
HEADER = Struct("<4sI")
"""Mark, number of axes."""
MEMORY_MARK = b"WLA1"
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


class TargetMemory:
    """The daemon's end, for a target of so many axes."""

    def __init__(self, axes: int) -> None:
        self._axes = axes
        self._map: mmap | None = None
        self._path = Path()

    def open(self) -> None:
        """Make the file, in place of one that a killed process left."""
        self.close()
        self._path = directory() / f"weberlink-{os.getpid()}.{LEADER}"
        fd, draft = mkstemp(prefix=f"{self._path.name}.", dir=self._path.parent)
        try:
            os.posix_fallocate(fd, 0, SIZE)
            mapping = mmap(fd, SIZE, flags=MAP_SHARED)
            mapping[: HEADER.size] = HEADER.pack(MEMORY_MARK, self._axes)
            Path(draft).replace(self._path)
        except BaseException:
            Path(draft).unlink()
            raise
        finally:
            os.close(fd)
        self._map, self._slot = mapping, Slot(mapping, TARGET_AT, TARGET)

    def newest(self) -> LeaderTarget | None:
        values = None if self._map is None else self._slot.newest()
        if values is None:
            return None
        leads, *angles = values
        target = tuple(angles[: self._axes])
        return LeaderTarget(target, bool(leads)) if joints.is_finite(target) else None

    def close(self) -> None:
        if self._map is not None:
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
        path = link_path(pid, LEADER)
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
        if status.st_size != SIZE or os.pread(self._fd, len(MEMORY_MARK), 0) != MEMORY_MARK:
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
        if len(angles) != self.axes or not joints.is_finite(angles):
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
