"""How often a device gives a new sample, and how old what it gives is; pure."""

from collections import deque

WINDOW_S = 1.0


class Gauge:
    """Told of every look at the device; speaks of the last second."""

    def __init__(self) -> None:
        self._arrivals: deque[tuple[float, float]] = deque()
        self._ages: deque[tuple[float, float]] = deque()
        self._began: float | None = None
        self._last_at: float | None = None

    def note(self, now: float, at: float, sampled_at: float | None = None) -> None:
        """A look at `now` [s] that found a reading of the moment `at` [s].

        `sampled_at` is when the newest sample behind the reading was measured, for a reading between two samples.
        """
        sampled_at = at if sampled_at is None else sampled_at
        if self._began is None:
            self._began = now
        if sampled_at != self._last_at:
            if self._last_at is not None:  # when the first one came is not known
                self._arrivals.append((now, sampled_at))
            self._last_at = sampled_at
        self._ages.append((now, now - at))
        for kept in (self._arrivals, self._ages):
            while kept and kept[0][0] <= now - WINDOW_S:
                kept.popleft()

    @property
    def rate_hz(self) -> float:
        """New samples per second."""
        if self._began is None:
            return 0.0
        window = min(WINDOW_S, self._ages[-1][0] - self._began)
        return len(self._arrivals) / window if window > 0.0 else 0.0

    @property
    def oldest_s(self) -> float:
        """The greatest age."""
        return max((age for _, age in self._ages), default=0.0)

    def in_words(self, round_trip_s: float | None = None) -> str:
        """In one line: samples per second, the greatest age, the time that an exchange takes."""
        words = f"{self.rate_hz:.0f}/s, age {self.oldest_s * 1e3:.1f} ms"
        return words if round_trip_s is None else f"{words}, trip {round_trip_s * 1e3:.2f} ms"
