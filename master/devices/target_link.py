"""Targets from another process of the same user, for a device or an arm that a program leads: datagrams on AF_UNIX.

The daemon of the master opens the socket as a file of mode 0600 in the runtime directory, which no other user can
enter. A datagram is complete in itself, so a lost one costs nothing once the next has arrived. One process at a time
leads an arm: it holds a lock on a file beside the socket, which the kernel removes with the process.
"""

import fcntl
import os
import select
import socket
import stat
from collections.abc import Callable
from contextlib import suppress
from math import isfinite, tau
from pathlib import Path
from struct import Struct
from struct import error as StructError  # noqa: N812 - as of an exception
from time import monotonic_ns
from typing import Generic, NamedTuple, Protocol, Self, TypeVar

from weberlink.geometry import joints
from weberlink.geometry.joints import MOST_JOINTS, Joints
from weberlink.geometry.vector import ZERO, Vector, is_finite, norm
from weberlink.telemetry.runtime_directory import check, directories, directory, listening_socket

POINTER, LEADER, LEADER_LOCK = KINDS = "pointer", "leader", "leader.lock"
"""Of files, by what follows the name of the process."""
LAYOUT = Struct("<4sQ?6d")
"""Mark, number, held, x, y, z [m], rotation vector [rad]."""
MARK = b"WLP2"
ANGLES_LAYOUT = Struct("<4sQ?")
"""Mark, number, leads; the angles of all axes [rad] follow as doubles."""
ANGLES_MARK = b"WLA2"
LONGEST = ANGLES_LAYOUT.size + 8 * (MOST_JOINTS + 1)
"""Bytes of a datagram."""
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


class LeaderTarget(NamedTuple):
    """Angles of all axes [rad], and whether the process that sent them leads; the highest number is the newest."""

    angles: Joints
    leads: bool
    number: int


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


def pack_angles(angles: Joints, leads: bool, number: int) -> bytes:
    """The datagram of a target for an arm; raises ValueError for an angle that is not finite."""
    if not joints.is_finite(angles):
        raise ValueError(f"expected finite angles, not {angles}")
    return ANGLES_LAYOUT.pack(ANGLES_MARK, number, leads) + Struct(f"<{len(angles)}d").pack(*angles)


def unpack_angles(data: bytes, axes: int) -> LeaderTarget:
    """The target of so many axes in a datagram; raises ValueError if it is none."""
    if len(data) != ANGLES_LAYOUT.size + 8 * axes:
        raise ValueError(f"a target of {axes} axes has {ANGLES_LAYOUT.size + 8 * axes} bytes, not {len(data)}")
    mark, number, leads = ANGLES_LAYOUT.unpack_from(data)
    angles: Joints = Struct(f"<{axes}d").unpack_from(data, ANGLES_LAYOUT.size)
    if mark != ANGLES_MARK or not joints.is_finite(angles):
        raise ValueError("not a target")
    return LeaderTarget(angles, leads, number)


def link_path(pid: int, kind: str) -> Path:
    """Where the daemon with this process id has a kind of file: the file if it is there, else its place.

    Raises:
        RuntimeDirectoryError: there is no place for it.
    """
    name = f"weberlink-{pid}.{kind}"
    found = (path for path in (folder / name for folder in directories()) if path.exists())
    return next(found, None) or directory() / name


Target = TypeVar("Target", PointerTarget, LeaderTarget)
Target_co = TypeVar("Target_co", covariant=True)


class TargetSource(Protocol[Target_co]):
    """Where a device or an arm gets its targets."""

    def open(self) -> None:
        """Begin; raises OSError if that is not possible."""

    def newest(self) -> Target_co | None:
        """The newest target that arrived since the last call; None if none did. Never waits, never raises."""

    def close(self) -> None:
        """End; may be repeated."""


class TargetSocket(Generic[Target]):
    """The daemon's end: takes the newest of the targets that have arrived, and ignores all else.

    Args:
        kind: of its file.
        decode: gives the target in a datagram, or raises ValueError.
    """

    def __init__(self, kind: str, decode: Callable[[bytes], Target]) -> None:
        self._kind = kind
        self._decode: Callable[[bytes], Target] = decode
        self._socket: socket.socket | None = None
        self._path = Path()
        self._number = -1

    def open(self) -> None:
        self.close()
        self._path = directory() / f"weberlink-{os.getpid()}.{self._kind}"
        listener = listening_socket(self._path)
        self._socket, self._number = listener, -1
        waiting = select.poll()
        waiting.register(listener.fileno(), select.POLLIN)
        self._waiting = waiting.poll

    def newest(self) -> Target | None:
        # To ask first costs a third of a read that finds nothing and raises an exception.
        if self._socket is None or not self._waiting(0):
            return None
        newest = None
        with suppress(OSError):  # no more are there
            for _ in range(MOST_A_TICK):
                with suppress(ValueError):  # ignored
                    arrived = self._decode(self._socket.recv(LONGEST + 1))
                    if arrived.number > self._number:
                        newest, self._number = arrived, arrived.number
        return newest

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None
            self._path.unlink(missing_ok=True)
            _lock_of(self._path).unlink(missing_ok=True)


def _lock_of(path: Path) -> Path:
    return path.with_name(f"{path.name}.lock")


class _Sender:
    """The other end. Its numbers are times, so those of a sender that replaces another one are newer."""

    def __init__(self, pid: int, kind: str) -> None:
        self._pid, self._kind = pid, kind
        self._socket: socket.socket | None = None
        self._last = 0

    def _number(self) -> int:
        self._last = max(self._last + 1, monotonic_ns())
        return self._last

    def _connect(self) -> Path:
        """The path of the socket; raises FileNotFoundError, or another OSError, also for a file of another user."""
        path = link_path(self._pid, self._kind)
        check(path, path.lstat(), stat.S_IFSOCK)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._socket.connect(str(path))
        return path

    def _send(self, data: bytes) -> bool:
        """Whether the daemon has it to read."""
        try:
            if self._socket is None:
                self._connect()
            assert self._socket is not None
            self._socket.send(data)
        except BlockingIOError:  # its queue is full
            return False
        except OSError:
            self._disconnect()
            return False
        return True

    def _disconnect(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None


class PointerSender(_Sender):
    """Sends targets to the daemon with a process id, which may begin later or end meanwhile."""

    def __init__(self, pid: int) -> None:
        super().__init__(pid, POINTER)

    def send(self, target: Vector, held: bool, rotation: Vector = ZERO) -> bool:
        """Send a target [m], turned by a rotation vector [rad]; repeat it at least every 33 ms while it is held.

        Returns:
            Whether the daemon has it to read; False if it is not there, or has not read those before.

        Raises:
            ValueError: the target is not finite, or is turned by more than a turn.
        """
        return self._send(pack(target, held, self._number(), rotation))

    def close(self) -> None:
        """Release the socket; may be repeated. Sends nothing: send `held` False before."""
        self._disconnect()


class TargetInUseError(RuntimeError):
    """Another process leads the arm."""


class LeaderSender(_Sender):
    """Leads the arm of the daemon with a process id, alone, until it is closed.

    Raises:
        FileNotFoundError: there is no such daemon, or its arm is no `remote_leader`.
        TargetInUseError: another process leads it.
        OSError: the socket cannot be used, or is another user's.
    """

    def __init__(self, pid: int) -> None:
        super().__init__(pid, LEADER)
        try:
            self._lock = self._locked(_lock_of(self._connect()))
        except BaseException as error:
            self._disconnect()
            if isinstance(error, ConnectionRefusedError):  # the daemon was killed
                raise FileNotFoundError(f"no daemon with process id {pid} has a remote leader") from None
            raise
        self._angles: Joints | None = None

    @staticmethod
    def _locked(path: Path) -> int:
        lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(lock)
            raise TargetInUseError(f"another process leads this arm already ({path}); end it first") from None
        return lock

    def send(self, angles: Joints) -> None:
        """Lead to these angles of all axes [rad]. Repeat it, at 30 Hz for example: a sender that is silent has let go.

        Raises:
            ValueError: an angle is not finite.
        """
        data = pack_angles(angles, True, self._number())
        self._angles = angles
        if self._socket is not None:  # else the daemon has ended; one that follows it is another's to lead
            self._send(data)

    def close(self) -> None:
        """Let go, and let another process lead; may be repeated."""
        if self._socket is not None and self._angles is not None:
            self._send(pack_angles(self._angles, False, self._number()))
        self._disconnect()
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
