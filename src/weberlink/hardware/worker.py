"""The thread that runs a blocking device: a tick only swaps a command for the newest sample. And a driver on it."""

import atexit
from collections.abc import Callable
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass
from math import inf
from queue import Empty, SimpleQueue
from threading import Event, Thread, current_thread
from time import monotonic
from typing import Any, ClassVar, Generic, Protocol, TypeVar

from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.guardian import Guardian

Command = TypeVar("Command")
Sample = TypeVar("Sample")
Command_contra = TypeVar("Command_contra", contravariant=True)
Sample_co = TypeVar("Sample_co", covariant=True)

RETRY_S = 0.05
# Longest time of bad replies in a row before they are a fault, however few they are [s]: a slow device sends few.
LOST_S = 1.0
JOIN_S = 1.0  # longest wait of `stop` for an exchange that hangs, and again at the end of the program [s]


class Exchange(Protocol[Command_contra, Sample_co]):
    """The blocking operations on a device; each of them has a time limit.

    With a board that keeps the last force without a host, it has a `guardian` too, a `Guardian`."""

    def open(self) -> Sample_co:
        """Connect, and give the first sample; after a disconnection also check that the device is still the same.
        Raises HardwareFault if it cannot be used."""
        ...

    def exchange(self, command: Command_contra) -> Sample_co:
        """Command, and measure. Raises BadReply if this answer was not good, and the next one may be; HardwareFault if
        the device is gone or refuses."""
        ...

    def close(self) -> None:
        """Leave the device safe; never raises, may be called again."""
        ...


@dataclass(eq=False)
class Worker(Generic[Command, Sample]):
    """Runs an exchange in a thread.

    The command is `rest` after a bad reply until a good one, while the last command is older than `stale`, and for the
    first command after such a gap, since the loop or the whole process may have been stopped. After each of these
    interruptions, and at the start, commands ramp up from zero if `scale` is given. After `bad_replies` in a row, bad
    ones for `LOST_S`, or when the device is gone, the fault stands unless a good reply comes within `reconnect`.

    Only the thread uses the exchange, so it need not be thread-safe. `stop` waits for a hanging exchange for a second;
    its `close` is called when it returns. The end of the program stops a running worker."""

    exchange: Exchange[Command, Sample]
    _: KW_ONLY
    rest: Command  # that is safe at any time
    period: float  # of the exchange [s]; with `on_command`, the longest pause
    on_command: bool  # a command starts an exchange at once; else the exchange keeps its own time
    stale: float  # age beyond which a command no longer counts [s]
    bad_replies: int  # how many in a row are a fault
    reconnect: float = 0.0  # how long to look for a device that is gone [s]; 0 for not at all
    scale: Callable[[Command, float], Command] | None = None  # gives a share of a command, 0 to 1
    ramp: float = 0.05  # how long the share takes from 0 to 1 [s]
    clock: Callable[[], float] = monotonic

    def __post_init__(self) -> None:
        self._guardian: Guardian | None = getattr(self.exchange, "guardian", None)
        # The last command, its time, and the number of gaps before it.
        self._command: tuple[Command, float, int] = (self.rest, -inf, 0)
        self._gaps_met = 0
        self._called_at = inf
        self._newest: tuple[Sample, float] | None = None
        self._wake = SimpleQueue[None]()
        self._stopping = Event()
        self._thread: Thread | None = None  # the last one
        self.fault: str | None = None  # why there are no more samples; None while they come
        self._error: Exception | None = None  # an error of the exchange's own code, which ended the thread
        self.trouble: str | None = None  # the error of the last exchange; None if there was none
        self.round_trip = 0.0  # time that the last exchange took [s]
        self._share = 0.0
        self._began = 0.0

    def check(self, kind: Callable[[str], Exception]) -> None:
        """Raise `fault`, as the error that `kind` makes of it; an error of the exchange's own code as it is."""
        if self._error is not None:
            raise self._error
        if self.fault is not None:
            raise kind(self.fault)

    @property
    def newest(self) -> tuple[Sample, float]:
        """The last good sample, and when it came [s]; to be asked for between `start` and `stop`."""
        assert self._newest is not None
        return self._newest

    def start(self) -> None:
        """Connect, and begin to exchange; raises HardwareFault if the device cannot be used, or still hangs since the
        last time; nothing is left running."""
        self.stop()
        if self._thread is not None and self._thread.is_alive():
            raise HardwareFault("it has not reacted since the last session; unplug it and plug it in again")
        try:
            self._begin()
            self._thread = Thread(target=self._run, name="weberlink-device", daemon=True)
            self._thread.start()
        except BaseException:
            self._thread = None
            self.exchange.close()
            raise
        atexit.register(self.stop)

    def _begin(self) -> None:
        """Connect, with nothing left of the last session."""
        self.fault = self.trouble = self._error = None
        self._share = 0.0
        self._command, self._called_at = (self.rest, -inf, self._gaps_met), inf
        self._newest = (self.exchange.open(), self.clock())
        self._wake = SimpleQueue()
        self._stopping.clear()

    def command(self, command: Command, now: float) -> None:
        """Set the command for the next exchange; never blocks. No effect when stopped."""
        called_at, gaps = self.clock(), self._command[2]
        self._command = (command, now, gaps + (called_at - self._called_at > self.stale))
        self._called_at = called_at
        if self.on_command and self._wake.empty():
            self._wake.put(None)

    def stop(self) -> None:
        """End the exchange and leave the device safe; may be called again, also from within the exchange."""
        thread = self._thread
        if thread is None or self._stopping.is_set():
            return
        self._stopping.set()
        self._wake.put(None)
        atexit.unregister(self.stop)
        if thread is not current_thread():
            thread.join(JOIN_S)
        if thread.is_alive():
            atexit.register(thread.join, JOIN_S)

    def _run(self) -> None:
        try:
            due = self.clock()
            while True:
                due = self._pause(due)
                if self._stopping.is_set():
                    break
                self._once()
        except HardwareFault as fault:
            self.fault = str(fault)
        except BaseException as error:  # an error in this thread must end the session too
            self._error = error if isinstance(error, Exception) else None
            self.fault = f"internal error: {error!r}"
        finally:
            try:
                self.exchange.close()
            except Exception as error:
                self.fault = self.fault or f"internal error: {error!r}"

    def _pause(self, due: float) -> float:
        """Wait for a command, or until `due`, or for `stop`; returns when the next exchange is due."""
        with suppress(Empty):
            self._wake.get(timeout=self.period if self.on_command else max(0.0, due - self.clock()))
        now, following = self.clock(), due + self.period
        return following if now < following else now + self.period  # missed exchanges are skipped

    def _once(self) -> None:
        """Exchange until a reply is good, reconnecting if needed; retries send the rest command."""
        command, at, gaps = self._command
        began = self.clock()
        if began - at > self.stale or gaps != self._gaps_met:
            command, self._share, self._gaps_met = self.rest, 0.0, gaps
        elif self.scale is not None and self._share < 1.0:
            # The steps of the ramp are limited however long the last exchange took.
            self._share = min(1.0, self._share + min(began - self._began, self.period) / self.ramp)
            command = self.scale(command, self._share)
        self._began = began
        if self._guardian is not None:
            self._guardian.given(at, self.stale)
        bad, bad_at, lost_at = 0, 0.0, None
        while not self._stopping.is_set():
            fault: HardwareFault
            try:
                sample = self.exchange.exchange(command)
            except BadReply as reply:
                bad_at = self.clock() if bad == 0 else bad_at
                bad += 1
                fault = reply
            except HardwareFault as gone:
                bad = self.bad_replies
                fault = gone
            else:
                ended = self.clock()
                self.round_trip = ended - began
                self._newest = (sample, ended)
                self.trouble = None
                return
            command, self._share = self.rest, 0.0
            self.trouble = str(fault)
            if bad >= self.bad_replies or self.clock() - bad_at > LOST_S:
                lost_at = began if lost_at is None else lost_at
                self._return(fault, lost_at + self.reconnect)
                bad = 0
            began = self.clock()

    def _return(self, fault: HardwareFault, until: float) -> None:
        """Reopen the device until the time is over; then raise the fault."""
        with suppress(Exception):  # the first fault is reported
            self.exchange.close()
        while not self._stopping.is_set():
            if self.clock() >= until:
                raise fault
            self._stopping.wait(RETRY_S)
            try:
                sample = self.exchange.open()
            except HardwareFault as again:
                fault = again
            else:
                self._newest = (sample, self.clock())
                return


class ThreadedDriver(Generic[Command, Sample]):
    """A driver whose exchange a `Worker` runs; times are of `time.monotonic` [s].

    An exchange with a method `start_afresh` keeps its state over reconnections, but not over sessions: it is called
    before the first `open` of each session. `options` are those of the worker."""

    FAULT: ClassVar[type[Exception]]  # what the contract of its family raises

    def __init__(self, name: str, exchange: Exchange[Command, Sample], **options: Any) -> None:
        self._name = name
        self.guarded = getattr(exchange, "guardian", None) is not None  # by a process, when this one stops
        self._worker: Worker[Command, Sample] = Worker(exchange, **options)
        self._is_open = False
        self._asked_at = -inf
        self._last: Any = None  # the reading of that time

    @property
    def trouble(self) -> str | None:
        return self._worker.trouble

    def open(self, now: float) -> None:  # noqa: ARG002
        self.close()
        if start_afresh := getattr(self._worker.exchange, "start_afresh", None):
            start_afresh()
        try:
            self._worker.start()
        except HardwareFault as fault:
            raise self._fault(str(fault)) from None
        self._is_open, self._asked_at = True, -inf

    def latest(self, now: float) -> Any:
        """The newest reading; the same one for the same `now`. Raises the fault of a driver that is not open, or that
        cannot go on."""
        if not self._is_open:
            raise self._fault("not open")
        self._worker.check(self._fault)
        if now > self._asked_at:
            self._asked_at, self._last = now, self._measured(now)
        return self._last

    def _measured(self, now: float) -> Any:  # noqa: ARG002
        """The reading of now: the newest sample, unless a subclass makes another of it."""
        return self._worker.newest[0]

    def close(self) -> None:
        self._is_open = False
        self._worker.stop()

    def _fault(self, why: str) -> Exception:
        """The fault with the driver's name in front, once."""
        name = f"{self._name}: "
        return self.FAULT(name + why.removeprefix(name))
