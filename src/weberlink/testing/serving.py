"""Serves an emulated device in a thread: the loop that carries its bytes, and a pseudo terminal as its port."""

import os
import tty
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from select import select
from threading import Event, Thread
from time import monotonic
from types import TracebackType
from typing import Self

from weberlink.hardware.emulator import Emulator, WireFaults

CHUNK = 4096
LONGEST_PAUSE_S = 0.02


def serve(
    emulator: Emulator,
    descriptor: int,
    stopping: Callable[[], bool],
    encode: Callable[[bytes], bytes] = bytes,
    receive: Callable[[bytes, float], None] | None = None,
) -> None:
    """Carry bytes between an emulator and a descriptor until told to stop, and add the wire faults.

    `encode` gives the bytes to write for a message, and `receive` takes what comes in place of the emulator. A read
    error does not end the loop: it may only mean that no host has the other end open.
    """
    receive = receive or emulator.receive
    leaving: deque[tuple[float, bytes]] = deque()
    while not stopping():
        now = monotonic()
        emulator.advance(now)
        faults = emulator.faults
        for reply in emulator.replies(now):
            if not faults.silent:
                leaving.append((now + faults.late_s, _garbled(reply, faults)))
        while leaving and leaving[0][0] <= now:
            try:
                os.write(descriptor, encode(leaving.popleft()[1]))
            except BlockingIOError:
                continue  # the host does not read
            except OSError:
                break
        due = [at for at in (emulator.next_timer(), leaving[0][0] if leaving else None) if at is not None]
        pause = min(LONGEST_PAUSE_S, max(0.0, min(due) - monotonic())) if due else LONGEST_PAUSE_S
        try:
            ready, _, _ = select((descriptor,), (), (), pause)
            if ready:
                receive(os.read(descriptor, CHUNK), monotonic())
        except OSError:
            select((), (), (), 0.001)


def _garbled(reply: bytes, faults: WireFaults) -> bytes:
    if faults.garble <= 0 or not reply:
        return reply
    faults.garble -= 1
    middle = len(reply) // 2
    return reply[:middle] + bytes([reply[middle] ^ 0x55]) + reply[middle + 1 :]


class ServedDevice(ABC):
    """While in the `with`, an emulated device answers at an address; the same one after every `unplug`.

    Args:
        begin: called first in the thread that serves it, for example to set its priority.
    """

    def __init__(self, begin: Callable[[], object]) -> None:
        self._begin = begin
        self.plugged = False
        self._stopping = Event()
        self._thread: Thread | None = None

    def __enter__(self) -> Self:
        self.plug()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.unplug()

    @property
    def serving(self) -> bool:
        """Whether the emulator still answers; False too after an exception in it."""
        return self._thread is not None and self._thread.is_alive()

    def plug(self) -> None:
        """Connect the device; raises OSError if its address is taken, or not permitted."""
        assert not self.plugged
        self._connect()
        self.plugged = True
        self._stopping.clear()
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()

    def unplug(self) -> None:
        """Disconnect it; whoever has it open gets an error. May be called again."""
        if not self.plugged:
            return
        self._stopping.set()
        assert self._thread is not None
        self._thread.join()
        self._disconnect()
        self.plugged = False

    def _run(self) -> None:
        self._begin()
        self._serve()

    @abstractmethod
    def _connect(self) -> None: ...

    @abstractmethod
    def _disconnect(self) -> None: ...

    @abstractmethod
    def _serve(self) -> None:
        """Answer until `_stopping` is set."""


class PtyDevice(ServedDevice):
    """A serial port with the emulator at its other end; only the thread that serves it calls its methods.

    `path` is that of the link that is made; it must not exist yet.
    """

    def __init__(self, emulator: Emulator, path: Path, *, begin: Callable[[], object] = lambda: None) -> None:
        super().__init__(begin)
        self.emulator = emulator
        self.path = path
        self._near = self._far = -1

    def _connect(self) -> None:
        near, far = os.openpty()
        try:
            self._prepare(far)
            os.set_blocking(near, False)
            self.path.symlink_to(os.ttyname(far))
        except BaseException:
            os.close(near)
            os.close(far)
            raise
        self._near, self._far = near, far  # the far end stays open: without one, the near end gives errors

    def _disconnect(self) -> None:
        os.close(self._near)
        os.close(self._far)
        with suppress(FileNotFoundError):
            self.path.unlink()

    def _prepare(self, far: int) -> None:
        """Set up the end that the host opens."""
        tty.setraw(far)

    def _serve(self) -> None:
        serve(self.emulator, self._near, self._stopping.is_set)
