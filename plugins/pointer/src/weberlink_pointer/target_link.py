"""Targets from another process of the same user, for a device or an arm that a program leads: datagrams on AF_UNIX.

The daemon of the master opens the socket as a file of mode 0600 in the runtime directory, which no other user can
enter. A datagram is complete in itself, so a lost one costs nothing once the next has arrived.
"""

import os
import select
import socket
import stat
from collections.abc import Callable
from contextlib import suppress
from math import isfinite, tau
from pathlib import Path
from struct import Struct, error as StructError  # noqa: N812 - as of an exception
from time import monotonic_ns
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

from weberlink.geometry.vector import ZERO, Vector, is_finite, norm
from weberlink.telemetry.runtime_directory import check, directories, directory, listening_socket

POINTER, LEADER = "pointer", "leader"  # kinds of files, by what follows the name of the process
LAYOUT = Struct("<4sQ?6d")  # mark, number, held, x, y, z [m], rotation vector [rad]
MARK = b"WLP2"
LONGEST = 128  # bytes of a datagram, of whatever kind of target
MOST_A_TICK = 16  # datagrams that one call of `TargetSocket.newest` reads; the kernel's queue holds 10 by default


class PointerTarget(NamedTuple):
    """Where the operator means the handle to be [m], and whether they hold it; the highest number is the newest.

    `rotation` is the rotation vector of how they mean to turn it [rad], at most one turn; a hand with a wrist follows.
    """

    target: Vector
    held: bool
    number: int
    rotation: Vector = ZERO


def pack(target: Vector, held: bool, number: int, rotation: Vector = ZERO) -> bytes:
    """The datagram of a target; raises ValueError if the target is not finite, its rotation is more than a turn, or the
    number is not one of 64 bits.
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


def link_path(pid: int, kind: str) -> Path:
    """Where the daemon with this process id has a kind of file: the file if it is there, else its place; raises
    RuntimeDirectoryError if there is no place for it.
    """
    name = f"weberlink-{pid}.{kind}"
    found = (path for path in (folder / name for folder in directories()) if path.exists())
    return next(found, None) or directory() / name


Target = TypeVar("Target", bound=Any)
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

    `kind` names its file; `decode` gives the target in a datagram, or raises ValueError.
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
            lock_of(self._path).unlink(missing_ok=True)


def lock_of(path: Path) -> Path:
    """Of a socket: what a program that leads alone holds locked; the kernel unlocks it with the process."""
    return path.with_name(f"{path.name}.lock")


class Sender:
    """The other end; a subclass says what it sends. Its numbers are times: those of a successor are newer."""

    def __init__(self, pid: int, kind: str) -> None:
        self._pid, self._kind = pid, kind
        self._socket: socket.socket | None = None
        self._newest = 0

    @property
    def is_connected(self) -> bool:
        return self._socket is not None

    def number(self) -> int:
        """That of the next target."""
        self._newest = max(self._newest + 1, monotonic_ns())
        return self._newest

    def connect(self) -> Path:
        """Connect to the socket, and give its path; OSError if it is not there, or of another user."""
        path = link_path(self._pid, self._kind)
        check(path, path.lstat(), stat.S_IFSOCK)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._socket.connect(str(path))
        return path

    def send_datagram(self, data: bytes) -> bool:
        """Whether the daemon has it to read."""
        try:
            if self._socket is None:
                self.connect()
            assert self._socket is not None
            self._socket.send(data)
        except BlockingIOError:  # its queue is full
            return False
        except OSError:
            self.disconnect()
            return False
        return True

    def disconnect(self) -> None:
        """Release the socket; may be repeated."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


class PointerSender(Sender):
    """Sends targets to the daemon with a process id, which may begin later or end meanwhile."""

    def __init__(self, pid: int) -> None:
        super().__init__(pid, POINTER)

    def send(self, target: Vector, held: bool, rotation: Vector = ZERO) -> bool:
        """Send a target [m], turned by a rotation vector [rad]; repeat it at least every 33 ms while it is held.

        Returns whether the daemon has it to read; False if it is not there, or has not read those before. Raises
        ValueError as `pack`.
        """
        return self.send_datagram(pack(target, held, self.number(), rotation))

    def close(self) -> None:
        """Release the socket; may be repeated. Sends nothing: send `held` False before."""
        self.disconnect()
