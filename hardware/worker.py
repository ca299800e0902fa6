"""The thread that owns a blocking device, so that a tick only ever swaps a command for the newest sample.

Owns the pace of the exchange, what is commanded when the tick or the device fails, and coming back after a
disconnection. Knows neither bytes nor units: a command and a sample are whatever the driver says.
"""

import os
from collections.abc import Callable
from contextlib import suppress
from select import select
from threading import Event, Thread
from time import monotonic
from typing import Generic, Protocol, TypeVar

from hardware.fault import BadReply, HardwareFault

Command = TypeVar("Command")
Sample = TypeVar("Sample")
Command_contra = TypeVar("Command_contra", contravariant=True)
Sample_co = TypeVar("Sample_co", covariant=True)

RETRY_S = 0.05
JOIN_S = 1.0


class Exchange(Protocol[Command_contra, Sample_co]):
    """What the thread does over and over. Every method blocks, but none without end."""

    def open(self) -> Sample_co:
        """Connect, and give the first sample.

        Called again after a disconnection, where it has to make sure that the device is still the one it was.

        Raises:
            HardwareFault: it cannot be used.
        """
        ...

    def exchange(self, command: Command_contra) -> Sample_co:
        """Command, and measure.

        Raises:
            BadReply: this once the answer was not good; the next may be.
            HardwareFault: the device is gone or refuses.
        """
        ...

    def close(self) -> None:
        """Leave it safe, as far as it still listens; never raises, any number of times."""
        ...


class Worker(Generic[Command, Sample]):
    """Runs an exchange in a thread.

    After a bad reply the command is `rest` until a reply is good again; it is `rest` too while the last command is
    older than `stale`: the loop that gives it may be what has failed. After `bad_replies` of them in a row, or when the
    device is gone, the fault stands, unless the device is back within `reconnect`.

    Args:
        exchange: of the device.
        rest: the command that is safe at any time.
        period: of the exchange [s].
        on_command: whether a command starts an exchange at once (`period` is then the longest pause); else the exchange
            keeps its own time.
        stale: age beyond which a command no longer counts [s].
        bad_replies: how many in a row are a fault.
        reconnect: how long to look for a device that is gone [s]; 0 for not at all.
        clock: monotonic [s].
    """

    def __init__(
        self,
        exchange: Exchange[Command, Sample],
        *,
        rest: Command,
        period: float,
        on_command: bool,
        stale: float,
        bad_replies: int,
        reconnect: float = 0.0,
        clock: Callable[[], float] = monotonic,
    ) -> None:
        self._exchange = exchange
        self._rest = rest
        self._period = period
        self._on_command = on_command
        self._stale = stale
        self._bad_replies = bad_replies
        self._reconnect = reconnect
        self._clock = clock
        self._command: tuple[Command, float] = (rest, 0.0)
        self._newest: tuple[Sample, float] | None = None
        self._wake = -1
        self._stopping = Event()
        self._thread: Thread | None = None
        self.fault: str | None = None
        """Why there are no more samples; None while there are."""
        self.round_trip = 0.0
        """Time that the last exchange took [s]."""
        self.bad_count = 0
        """Bad replies since the start."""
        self.connected_at = 0.0
        """When the device was last connected [s]."""

    @property
    def newest(self) -> tuple[Sample, float]:
        """The last good sample, and when it came [s]; to be asked for between `start` and `stop`."""
        assert self._newest is not None
        return self._newest

    def start(self) -> None:
        """Connect, and begin to exchange.

        Raises:
            HardwareFault: the device cannot be used; nothing is left running.
        """
        self.stop()
        self.fault = None
        self.bad_count = 0
        self._command = (self._rest, 0.0)
        try:
            self._newest = (self._exchange.open(), self._clock())
        except BaseException:
            self._exchange.close()
            raise
        self.connected_at = self._newest[1]
        self._stopping.clear()
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._thread = Thread(target=self._run, name="weberlink-device", daemon=True)
        self._thread.start()

    def command(self, command: Command, now: float) -> None:
        """Leave a command for the next exchange; returns at once. No effect when stopped."""
        self._command = (command, now)
        if self._on_command and self._wake >= 0:
            os.eventfd_write(self._wake, 1)

    def stop(self) -> None:
        """End the exchange and leave the device safe; any number of times."""
        thread, self._thread = self._thread, None
        if thread is None:
            return
        self._stopping.set()
        os.eventfd_write(self._wake, 1)
        thread.join(JOIN_S)
        wake, self._wake = self._wake, -1
        os.close(wake)

    def _run(self) -> None:
        wake = self._wake
        try:
            due = self._clock()
            while not self._stopping.is_set():
                due = self._pause(wake, due)
                if self._stopping.is_set():
                    break
                self._once()
        except HardwareFault as fault:
            self.fault = str(fault)
        except Exception as error:  # a mistake of ours in this thread must end the session all the same
            self.fault = f"internal error: {error!r}"
        finally:
            self._exchange.close()

    def _pause(self, wake: int, due: float) -> float:
        """Wait for a command or for the time; returns when the one after this is due."""
        if self._on_command:
            select((wake,), (), (), self._period)
            self._clear(wake)
            return due
        wait = due - self._clock()
        if wait > 0.0:
            self._stopping.wait(wait)
        # What was missed is not made up for.
        return max(due, self._clock() - self._period) + self._period

    @staticmethod
    def _clear(wake: int) -> None:
        with suppress(BlockingIOError):
            os.eventfd_read(wake)

    def _once(self) -> None:
        """One good exchange; on the way there, bad ones and a reconnection, all of them at rest."""
        command, at = self._command
        if self._clock() - at > self._stale:
            command = self._rest
        bad = 0
        while not self._stopping.is_set():
            began = self._clock()
            try:
                sample = self._exchange.exchange(command)
            except BadReply as reply:
                bad += 1
                self.bad_count += 1
                if bad >= self._bad_replies:
                    self._return(reply)
                    bad = 0
            except HardwareFault as fault:
                self._return(fault)
            else:
                ended = self._clock()
                self.round_trip = ended - began
                self._newest = (sample, ended)
                return
            command = self._rest

    def _return(self, fault: HardwareFault) -> None:
        """Look for the device until the patience is over; raises the fault then."""
        self._exchange.close()
        until = self._clock() + self._reconnect
        while not self._stopping.is_set():
            if self._clock() >= until:
                raise fault
            self._stopping.wait(RETRY_S)
            try:
                sample = self._exchange.open()
            except HardwareFault as again:
                fault = again
            else:
                self._newest = (sample, self._clock())
                self.connected_at = self._newest[1]
                return
