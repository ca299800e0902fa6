"""How long something has been without a sign of life. Told the time; owns no clock."""

from math import inf


class Watchdog:
    """Expires when it is not fed for longer than a limit.

    Args:
        limit: longest time without food [s], > 0.
    """

    __slots__ = ("_fed_at", "_limit")

    def __init__(self, limit: float) -> None:
        if not limit > 0.0:
            raise ValueError(f"limit must be positive, not {limit!r}")
        self._limit = limit
        self._fed_at = inf

    def feed(self, now: float) -> None:
        self._fed_at = now

    def expired(self, now: float) -> bool:
        """Whether the limit has passed; the time runs from the first question or food, whichever comes first."""
        if self._fed_at == inf:
            self._fed_at = now
        return now - self._fed_at > self._limit
