"""Targets for the `pointer` device from another process of the same user: datagrams on an AF_UNIX socket.

The daemon of the master opens the socket as a file of mode 0600 in the runtime directory, which no other user can
enter. A datagram is complete in itself, so a lost one costs nothing once the next has arrived.
"""

import os
import select
import socket
import stat
from contextlib import suppress
from math import isfinite, tau
from pathlib import Path
from struct import Struct
from struct import error as StructError  # noqa: N812 - as of an exception
from time import monotonic_ns
from typing import NamedTuple, Protocol

from weberlink.geometry.vector import ZERO, Vector, is_finite, norm
from weberlink.telemetry.runtime_directory import check, directories, directory, listening_socket

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
    """The target in a datagram.

    Raises:
        ValueError: it is none.
    """
    if len(data) != LAYOUT.size:
        raise ValueError(f"a target has {LAYOUT.size} bytes, not {len(data)}")
    mark, number, held, x, y, z, *turn = LAYOUT.unpack(data)
    rotation = (turn[0], turn[1], turn[2])
    if mark != MARK or not (isfinite(x) and isfinite(y) and isfinite(z) and norm(rotation) <= tau):
        raise ValueError("not a target")
    return PointerTarget((x, y, z), held, number, rotation)


def socket_path(pid: int) -> Path:
    """Where the daemon with this process id listens: the socket if it is there, else where it would be.

    Raises:
        RuntimeDirectoryError: there is no place for it.
    """
    name = f"weberlink-{pid}.pointer"
    found = (path for path in (folder / name for folder in directories()) if path.is_socket())
    return next(found, None) or directory() / name


class TargetSource(Protocol):
    """Where a pointer device gets its targets."""

    def open(self) -> None:
        """Begin; raises OSError if that is not possible."""

    def newest(self) -> PointerTarget | None:
        """The newest target that arrived since the last call; None if none did. Never waits, never raises."""

    def close(self) -> None:
        """End; may be repeated."""


class TargetSocket:
    """The daemon's end: takes the newest of the targets that have arrived, and ignores all else."""

    def __init__(self) -> None:
        self._socket: socket.socket | None = None
        self._path: Path | None = None
        self._number = -1

    def open(self) -> None:
        """Listen.

        Raises:
            OSError: there is no place for the socket's file.
        """
        self.close()
        self._path = directory() / f"weberlink-{os.getpid()}.pointer"
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
        """Remove the socket; may be repeated."""
        if self._socket is None or self._path is None:
            return
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
                self._socket = self._connected()
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

    def _connected(self) -> socket.socket:
        path = socket_path(self._pid)
        check(path, path.lstat(), stat.S_IFSOCK)
        sender = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        try:
            sender.connect(str(path))
        except BaseException:
            sender.close()
            raise
        return sender
