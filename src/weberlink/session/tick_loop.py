"""The event loop of a daemon: ticks, signals, and how a run ends."""

import asyncio
from collections.abc import Callable, Sequence
from contextlib import suppress
from math import inf
from signal import SIG_UNBLOCK, SIGHUP, SIGINT, Signals, pthread_sigmask
from time import monotonic
from typing import NamedTuple

import uvloop

from weberlink.order import STOP_SIGNALS
from weberlink.protocol.aio.udp import UdpShell
from weberlink.realtime.garbage import GarbageSchedule, freeze_garbage, thaw_garbage
from weberlink.realtime.ticker import Ticker
from weberlink.session.side import Side

GARBAGE_EVERY_S = 1.0
REASONS = {SIGINT: "interrupted", SIGHUP: "hung up"}
AfterTick = Callable[[int, float, float, float], None]
"""Receives the deadlines missed so far, deadline and now [s], and the time from now to the end of `flush` [us]."""


class Run(NamedTuple):
    """How the run ended, and whether without `Side.fail`."""

    outcome: str | None
    orderly: bool


class TickLoop:
    """Runs a side in this process until it has stopped.

    In a tick: `transport.service`, `side.tick`, `transport.flush`, `after_tick`, then garbage collection if there is
    slack; what lives as the ticks begin is exempt from it. A run ends when the side is `stopped`: by itself, or after
    `side.stop` at the first signal ("interrupted", "terminated", "hung up") or at the end of the duration
    ("completed"). A second signal other than a hang-up, or a stop that takes too long, ends it at once through
    `side.fail`.

    Args:
        period: time between ticks [s].
        duration_s: from the first tick to the stop [s]; None for no end.
        start_at: the first deadline [s, `time.monotonic`]; None for one period after opening.
        stop_limit_s: hard bound on an orderly stop [s].
        on_open: begins what works in the loop beside its ticks, before the transport opens.
        on_close: ends it while the loop still runs.
        busy_poll: poll sockets and clock instead of sleeping between ticks (`Ticker`); takes a processor.
    """

    def __init__(
        self,
        side: Side,
        transport: UdpShell,
        period: float,
        *,
        duration_s: float | None = None,
        start_at: float | None = None,
        stop_limit_s: float = 1.0,
        on_open: Sequence[Callable[[asyncio.AbstractEventLoop], None]] = (),
        on_close: Sequence[Callable[[], None]] = (),
        after_tick: AfterTick | None = None,
        busy_poll: bool = False,
    ) -> None:
        self._ticker = Ticker(period, self._tick, start_at=start_at, on_error=self._fault, polls=busy_poll)
        self._side = side
        self._transport = transport
        self._period = self._ticker.period_s
        self._duration = inf if duration_s is None else round(duration_s / self._period)
        self._stop_at_index: float | None = None
        self._stop_limit = stop_limit_s
        self._stop_by = inf
        self._on_open, self._on_close, self._after_tick = on_open, on_close, after_tick
        self._garbage = GarbageSchedule(max(1, round(GARBAGE_EVERY_S / self._period)))
        self._reason: str | None = None
        self._error: BaseException | None = None
        self._failed = False
        self._signalled = False
        self._done = asyncio.Event()

    def run(self) -> Run:
        """Run to the end; once for each object, in the main thread. Raises whatever the side, the transport or a
        callback of the loop raised; by then `side.fail` has been called and the transport is closed."""
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            runner.run(self._run())
        if self._error is not None:
            raise self._error
        return Run(self._side.outcome or self._reason, not self._failed)

    async def _run(self) -> None:
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(
            lambda _loop, context: self._fault(context.get("exception") or RuntimeError(context["message"]))
        )
        for number in STOP_SIGNALS:
            loop.add_signal_handler(number, self._signal, number)
        # A parent may have blocked them until there is a handler.
        pthread_sigmask(SIG_UNBLOCK, STOP_SIGNALS)
        try:
            for begin in self._on_open:
                begin(loop)
            await self._open(loop)
            if not self._done.is_set():
                await self._live()
        except BaseException as error:
            self._fault(error)
        finally:
            self._ticker.stop()
            for number in STOP_SIGNALS:
                loop.remove_signal_handler(number)
            for end in self._on_close:
                end()
            self._transport.close()

    async def _open(self, loop: asyncio.AbstractEventLoop) -> None:
        """Open the transport, unless a stop comes first: looking up a host may take long."""
        ready, ended = loop.create_task(self._transport.open(loop)), loop.create_task(self._done.wait())
        try:
            await asyncio.wait((ready, ended), return_when=asyncio.FIRST_COMPLETED)
            if ready.done():
                ready.result()
        finally:
            for waiting in (ready, ended):
                waiting.cancel()
            await asyncio.gather(ready, ended, return_exceptions=True)

    async def _live(self) -> None:
        freeze_garbage()
        try:
            self._ticker.start()
            await self._done.wait()
        finally:
            thaw_garbage()

    def _tick(self, index: int, deadline: float, now: float) -> None:
        if self._stop_at_index is None:
            self._stop_at_index = index + self._duration
        if self._reason is None and index >= self._stop_at_index:
            self._stop(now, "completed")
        if now >= self._stop_by:
            self._abandon(TimeoutError(f"the stop took longer than {self._stop_limit} s"))
            return
        self._transport.service(now)
        self._side.tick(index, deadline, now)
        self._transport.flush(now, deadline + self._period)
        if self._after_tick is not None:
            self._after_tick(self._ticker.missed, deadline, now, (monotonic() - now) * 1e6)
        if self._side.stopped:
            self._finish()
        else:
            self._garbage.tick(deadline + self._period - monotonic())

    def _stop(self, now: float, reason: str) -> None:
        self._reason = reason
        self._stop_by = now + self._stop_limit
        self._side.stop(now, reason)

    def _signal(self, number: Signals) -> None:
        reason = REASONS.get(number, "terminated")
        if self._signalled:
            if number != SIGHUP:
                self._abandon(InterruptedError(f"{reason} a second time"))
            return
        self._signalled = True
        if self._reason is None:
            self._stop(monotonic(), reason)
        if not self._ticker.running:
            self._finish()  # nothing has moved yet, and there is no tick that would finish the stop

    def _fault(self, error: BaseException) -> None:
        if self._error is None:
            self._error = error
        self._abandon(error)

    def _abandon(self, error: BaseException) -> None:
        if not self._failed:
            self._failed = True
            now = monotonic()
            # Best effort: what failed first is what must be reported.
            with suppress(Exception):
                self._side.fail(now, error)
            with suppress(Exception):
                self._transport.flush(now)
        self._finish()

    def _finish(self) -> None:
        self._ticker.stop()
        self._done.set()
