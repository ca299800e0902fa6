"""Emulated devices: the interface of one, the loop that carries its bytes, and the pseudo terminal that serves it."""

import os
import tty
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from select import select
from threading import Event, Thread
from time import monotonic
from types import TracebackType
from typing import Any, ClassVar, Protocol, Self

from pydantic import BaseModel

CHUNK = 4096
LONGEST_PAUSE_S = 0.02


@dataclass
class WireFaults:
    """Faults between device and host; may be changed at any time, from any thread.

    Args:
        garble: number of replies to come in which a byte is changed.
        late_s: every reply leaves this much later [s].
        silent: replies are lost.
    """

    garble: int = 0
    late_s: float = 0.0
    silent: bool = False


class Emulator(Protocol):
    """A device on the wire, without I/O. `now` [s] never goes back."""

    faults: WireFaults

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes as they come, or one HID report without its number."""
        ...

    def advance(self, now: float) -> None:
        """Move mechanics, watchdog and timers on to `now`."""
        ...

    def replies(self, now: float) -> list[bytes]:
        """The messages that leave the device by `now`, oldest first; each of them once."""
        ...

    def next_timer(self) -> float | None:
        """When `advance` or `replies` must be called next if nothing arrives [s]; None for never."""
        ...


class EmulatorClass(Protocol):
    """An emulator class: its options, its transport (serial, hid, evdev, or one of its own), and its own faults.

    `OWN_FAULTS` says what each value does. Emulators of the kernel's devices (hid, evdev) have `identity`, a
    `weberlink.hardware.umockdev.Identity`. One with a transport of its own has `served(begin)`, which gives the
    `ServedDevice` for the arguments of that class, with its `address`.
    """

    Options: ClassVar[type[BaseModel]]
    transport: ClassVar[str]
    OWN_FAULTS: ClassVar[Mapping[str, str]]
    __call__: Any


class FaultyDevice(ABC):
    """The faults of an emulator: those of its wire, and its own, which happen when it is advanced next."""

    OWN_FAULTS: ClassVar[Mapping[str, str]] = {}
    """What each of its own does."""
    fault_values: Mapping[str, range | float] = {}
    """The whole numbers that a fault takes, or the limit of its values either way; any number if there is none."""

    def __init__(self) -> None:
        self.faults = WireFaults()
        self._injected: deque[tuple[str, float]] = deque()

    def inject(self, name: str, value: float = 1.0) -> None:
        """Cause one of `OWN_FAULTS` at the next `advance`; from any thread.

        Raises:
            ValueError: there is none of that name, or not with that value.
        """
        if name not in self.OWN_FAULTS:
            raise ValueError(f"no fault is called {name!r}; there are {', '.join(self.OWN_FAULTS)}")
        values = self.fault_values.get(name)
        if isinstance(values, range) and value not in values:
            raise ValueError(f"{name}: expected a whole number from {values[0]} to {values[-1]}, got {value:g}")
        if isinstance(values, float) and not abs(value) <= values:
            raise ValueError(f"{name}: expected a number within +-{values:g}, got {value:g}")
        self._injected.append((name, value))

    def take_faults(self) -> None:
        """Apply what was injected; to be called by `advance`."""
        while self._injected:
            self.apply_fault(*self._injected.popleft())

    @abstractmethod
    def apply_fault(self, name: str, value: float) -> None:
        """Let one of `OWN_FAULTS` happen now."""


def serve(
    emulator: Emulator,
    descriptor: int,
    stopping: Callable[[], bool],
    clock: Callable[[], float] = monotonic,
    encode: Callable[[bytes], bytes] = bytes,
) -> None:
    """Carry bytes between an emulator and a descriptor until told to stop, and add the wire faults.

    `encode` gives the bytes to write for a message. A read error does not end the loop: it may only mean that no host
    has the other end open.
    """
    leaving: deque[tuple[float, bytes]] = deque()
    while not stopping():
        now = clock()
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
        _wait(emulator, descriptor, leaving[0][0] if leaving else None, clock)


def _wait(emulator: Emulator, descriptor: int, leaves_at: float | None, clock: Callable[[], float]) -> None:
    """Wait until something arrives, or the next timer is due."""
    due = [each for each in (emulator.next_timer(), leaves_at) if each is not None]
    pause = min(LONGEST_PAUSE_S, max(0.0, min(due) - clock())) if due else LONGEST_PAUSE_S
    try:
        ready, _, _ = select((descriptor,), (), (), pause)
        if ready:
            emulator.receive(os.read(descriptor, CHUNK), clock())
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
        self._plugged = False
        self._stopping = Event()
        self._thread: Thread | None = None

    def __enter__(self) -> Self:
        self.plug()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.unplug()

    @property
    def plugged(self) -> bool:
        return self._plugged

    @property
    def serving(self) -> bool:
        """Whether the emulator still answers; False too after an exception in it."""
        return self._thread is not None and self._thread.is_alive()

    def plug(self) -> None:
        """Connect the device.

        Raises:
            OSError: its address is taken, or not permitted.
        """
        assert not self._plugged
        self._connect()
        self._plugged = True
        self._stopping.clear()
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()

    def unplug(self) -> None:
        """Disconnect it; whoever has it open gets an error. May be called again."""
        if not self._plugged:
            return
        self._stopping.set()
        assert self._thread is not None
        self._thread.join()
        self._disconnect()
        self._plugged = False

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
    """A serial port with the emulator at its other end.

    Args:
        emulator: the device; only the thread that serves it calls its methods.
        path: of the link that is made; must not exist yet.
        begin: see `ServedDevice`.
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
