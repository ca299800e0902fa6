"""Detect stalls of this process, from times that the caller passes in."""

LEAST_STALL = 0.02
"""No shorter pause counts as a stall [s]: a busy host delays a tick by some milliseconds now and then."""
STALL_TICKS = 10  # ticks that must be missed in a row to count as a stall, where that is longer
SETTLING_TICKS = 5
"""Ticks from a stall on in which a side does not lead, so that the peer is told before a new command reaches it."""
LONGEST_STEP = 2  # a late tick moves ramps, slew limits and speed limits on by at most this many tick periods


class StallDetector:
    """Measures the time between ticks, and distinguishes a late tick from a stall.

    A process stalls when it is stopped (SIGSTOP), when its host is suspended, or when something blocks its loop.
    What the process knew before a stall is old: hand and robot may have moved meanwhile.
    """

    __slots__ = ("_last", "_longest_step", "_ticks_to_settle", "limit", "settling", "stalled", "step")

    def __init__(self, tick_period: float) -> None:
        self.limit = max(LEAST_STALL, STALL_TICKS * tick_period)  # a tick that is later after the last one ends a stall
        self._longest_step = LONGEST_STEP * tick_period
        self._last: float | None = None
        self._ticks_to_settle = 0
        self.stalled = False  # whether the newest tick ended a stall
        self.settling = False  # whether it is one of the first `SETTLING_TICKS` from a stall on
        self.step = 0.0  # by how much ramps and limits may go on in the newest tick [s]; 0 if it is the first

    def tick(self, now: float) -> float:
        """Count a tick; returns the time since the last one [s], 0 if it is the first or ended a stall."""
        elapsed = 0.0 if self._last is None else now - self._last
        self._last = now
        if self.settling or elapsed > self.limit:
            self.stalled = elapsed > self.limit
            if self.stalled:
                elapsed, self._ticks_to_settle = 0.0, SETTLING_TICKS
            self.settling = self._ticks_to_settle > 0
            self._ticks_to_settle -= 1
        self.step = elapsed if elapsed < self._longest_step else self._longest_step
        return elapsed
