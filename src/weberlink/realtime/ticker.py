"""The tick: a callback at absolute deadlines of the monotonic clock, driven by a timerfd in the running event loop."""

import asyncio
import os
from collections.abc import Callable
from math import isfinite
from time import monotonic_ns

from weberlink.realtime import timerfd

NANOSECONDS = 1_000_000_000
SHORTEST_PERIOD_S = 1e-5
LARGEST_ADVANCE_S, LARGEST_ADVANCE_SHARE = 1e-4, 0.2
"""Bounds of the timer's advance: a time [s] and a share of the period. So busy waiting is short; on a machine that
takes longer to wake up, ticks are late."""
# Wake-ups until the advance is first set, and the time between two revisions [s].
_FIRST_REVISION, _REVISED_EVERY_S = 50, 1.0
POLL_REST_SHARE = 0.1
"""Share of the period in which a polling ticker sleeps after each tick. The kernel leaves real-time tasks 95 % of a
processor unless told otherwise, and stops one that takes more for the rest of a second."""
_LAST_POLL_NS = 20_000
"""Time before a deadline from which a polling ticker watches only the clock, longer than the loop takes to come round
[ns]."""
# Share of wake-ups that come within the advance: with a larger one, more CPU time goes into busy waiting.
_WOKEN_BY = 0.5


class Ticker:
    """Calls `on_tick(index, deadline, now)` once per wake-up, for the newest deadline that has passed.

    Deadline `index` is `start_at + index * period_s` in integer nanoseconds, so that no error accumulates. When several
    deadlines have passed since the last wake-up, the older ones are counted in `missed` and never replayed: a burst of
    late ticks would send a device commands that are out of date. Deadlines before the first wake-up do not count:
    opening a device may take as long as a person needs to home it.

    A wake-up takes some time from the timer to the first line of Python. The timer is therefore set ahead by
    the median of the last wake-ups, revised once a second and bounded by `LARGEST_ADVANCE_S` and
    `LARGEST_ADVANCE_SHARE`; the rest is busy waiting.

    A polling ticker (`polls`) keeps the event loop running instead: but for a short rest after each tick, the loop asks
    its sockets again and again, so neither a datagram nor a deadline waits for the processor to wake up.

    Args:
        period_s: time between deadlines [s], rounded to 1 ns.
        on_tick: receives the index, its deadline and the present [s, clock of `time.monotonic`].
        start_at: deadline of index 0 [s, same clock]; one period after `start()` if not given.
        on_error: receives what `on_tick` raised, after the ticker has stopped; None to raise it into the event loop.
        advance: False to be woken at the deadlines themselves.
        polls: whether to poll, which takes a processor.
    """

    def __init__(
        self,
        period_s: float,
        on_tick: Callable[[int, float, float], None],
        *,
        start_at: float | None = None,
        on_error: Callable[[BaseException], None] | None = None,
        advance: bool = True,
        polls: bool = False,
    ) -> None:
        if not (isfinite(period_s) and period_s >= SHORTEST_PERIOD_S):
            raise ValueError(f"period_s must be finite and at least {SHORTEST_PERIOD_S} s, got {period_s}")
        if start_at is not None and not (isfinite(start_at) and start_at > 0.0):
            raise ValueError(f"start_at must be a positive time of time.monotonic, got {start_at}")
        self._period_ns = round(period_s * NANOSECONDS)
        self._start_ns = 0 if start_at is None else round(start_at * NANOSECONDS)
        self._on_tick = on_tick
        self._on_error = on_error
        self._is_advanced = advance and not polls
        self._polls = polls
        self._advance_ns = 0
        self._latencies: list[int] = []
        self._revised_after = _FIRST_REVISION
        self._loop: asyncio.AbstractEventLoop | None = None
        self._fd = -1
        self._index = -1
        self._stopped = False
        self.missed = 0

    @property
    def period_s(self) -> float:
        """The period as it is kept, after rounding to nanoseconds [s]."""
        return self._period_ns / NANOSECONDS

    @property
    def running(self) -> bool:
        return self._loop is not None

    def start(self) -> None:
        """Arm the timer in the running event loop; does nothing if it runs already. Raises RuntimeError outside an
        event loop, or after `stop`: a ticker serves one run."""
        if self._loop is not None:
            return
        if self._stopped:
            raise RuntimeError("a stopped ticker does not start again; make a new one")
        loop = asyncio.get_running_loop()
        self._fd = timerfd.create()
        if self._start_ns == 0:
            self._start_ns = monotonic_ns() + self._period_ns
        if self._polls:
            timerfd.arm(self._fd, monotonic_ns(), 0)
        else:
            timerfd.arm(self._fd, self._start_ns, self._period_ns)
        loop.add_reader(self._fd, self._wake)
        self._loop = loop

    def stop(self) -> None:
        """Disarm and release the timer; may be called inside a tick, and again."""
        self._stopped = True
        if self._loop is None:
            return
        # That of uvloop returns None and not the bool of its type, which compiled code would check.
        forget: Callable[[int], object] = self._loop.remove_reader
        forget(self._fd)
        os.close(self._fd)
        self._loop = None

    def _wake(self) -> None:
        passed = timerfd.expirations(self._fd)
        if passed == 0:
            return
        if self._polls:
            self._poll()
            return
        now = monotonic_ns()
        latency = now - self._deadline(passed) + self._advance_ns
        self._tick(passed, now)
        if self._is_advanced and self._loop is not None:
            self._learn(latency)

    def _poll(self) -> None:
        """Come round with the event loop until the next deadline; then tick, and rest."""
        if self._loop is None:
            return
        now, deadline = monotonic_ns(), self._deadline(1)
        if deadline - now > _LAST_POLL_NS:
            self._loop.call_soon(self._poll)
            return
        self._tick(1 + max(0, now - deadline) // self._period_ns, now)
        if self._loop is not None:
            rest = int(POLL_REST_SHARE * self._period_ns)
            timerfd.arm(self._fd, monotonic_ns() + rest, 0)

    def _deadline(self, passed: int) -> int:
        """The deadline that comes so many after that of the last tick [ns]."""
        return self._start_ns + (self._index + passed) * self._period_ns

    def _tick(self, passed: int, now: int) -> None:
        """Wait for the last of so many deadlines if it is ahead, and do its tick."""
        if self._index >= 0:
            self.missed += passed - 1
        self._index += passed
        deadline = self._deadline(0)
        while now < deadline:
            now = monotonic_ns()
        try:
            self._on_tick(self._index, deadline / NANOSECONDS, now / NANOSECONDS)
        except BaseException as error:
            self.stop()
            if self._on_error is None:
                raise
            self._on_error(error)

    def _learn(self, latency: int) -> None:
        """Note how long a wake-up took [ns]; now and then, set the timer ahead by the median."""
        latencies = self._latencies
        latencies.append(latency)
        if len(latencies) < self._revised_after:
            return
        latencies.sort()
        usual = latencies[int(len(latencies) * _WOKEN_BY)]
        latencies.clear()
        self._revised_after = max(_FIRST_REVISION, round(_REVISED_EVERY_S / self.period_s))
        largest = min(LARGEST_ADVANCE_S * NANOSECONDS, LARGEST_ADVANCE_SHARE * self._period_ns)
        self._advance_ns = int(min(usual, largest))
        timerfd.arm(self._fd, self._deadline(1) - self._advance_ns, self._period_ns)
