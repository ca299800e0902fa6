"""Drivers in virtual time: a serial port in it, and a worker that a test steps, which starts no thread."""

from collections.abc import Callable
from typing import Any

from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.worker import Worker


class VirtualTime:
    def __init__(self) -> None:
        self.now = 100.0

    def clock(self) -> float:
        return self.now

    def pause(self, time: float) -> None:
        self.now += time


class KilledError(BaseException):
    """The host ends here: nothing that comes after this is sent."""


class VirtualPort:
    """As `hardware.serial_port.SerialPort`; silence and garbled answers are those of the emulator's `faults`."""

    path = "/dev/virtual"

    def __init__(self, emulator: Any, time: VirtualTime, latency: float = 0.0) -> None:
        self._emulator, self._time = emulator, time
        self.latency = latency
        self.closed = False
        self.broken: Exception | None = None  # what every access raises
        self.killed_after: int | None = None  # messages that still get out before the host is gone; None for all
        self.sent: list[bytes] = []  # all messages
        emulator.advance(time.now)

    def write(self, data: bytes) -> None:
        self._check()
        if self.killed_after is not None:
            if self.killed_after == 0:
                raise KilledError
            self.killed_after -= 1
        self.sent.append(data)
        self._emulator.receive(data, self._time.now)

    def _check(self) -> None:
        assert not self.closed
        if self.broken is not None:
            raise self.broken

    def read(self, until: float) -> bytes:
        self._check()
        while True:
            said = self.drain()
            if said or self._time.now >= until:
                return said
            due = self._emulator.next_timer()
            self._time.now = min(until, max(self._time.now + 1e-6, until if due is None else due + self.latency))

    def drain(self) -> bytes:
        self._check()
        emulator, faults = self._emulator, self._emulator.faults
        emulator.advance(self._time.now)
        replies = emulator.replies(self._time.now - self.latency)
        if faults.silent:
            return b""
        if faults.garble and replies:
            faults.garble -= 1
            replies[0] = replies[0][:-1] + bytes([replies[0][-1] ^ 0x55])
        return b"".join(replies)

    def close(self) -> None:
        self.closed = True


class SteppedWorker(Worker[Any, Any]):
    """Runs the exchange when it is due."""

    _runs = False
    _due = 0.0

    @classmethod
    def of(cls, driver: Any, clock: Callable[[], float]) -> "SteppedWorker":
        """Take the thread off a driver that is not open; its time is that of a clock from now on."""
        worker = driver._worker
        worker.__class__, worker.clock = cls, clock
        assert isinstance(worker, cls)
        return worker

    def start(self) -> None:
        self.stop()
        self._begin()
        self._due = self.clock()
        self._runs = True

    def step(self) -> None:
        """Exchange as often as it is due."""
        while self._runs and self._due <= self.clock():
            self._due = max(self._due + self.period, self.clock())
            try:
                self._once()
            except HardwareFault as fault:
                self.fault = str(fault)
                self.stop()

    def stop(self) -> None:
        if self._runs:
            self._runs = False
            self.exchange.close()
