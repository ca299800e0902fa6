"""A histogram of durations in bins of one microsecond, with a fixed size however long a run lasts.

Owns counts, never the samples. Knows nothing of what was timed.
"""

from array import array
from math import ceil, inf, nan

PERCENTILES = {"p50": 50.0, "p99": 99.0, "p99_9": 99.9}


class Histogram:
    """Counts of durations rounded to 1 us, up to `limit_us`; longer ones share one bin, the largest is kept exactly.

    Args:
        limit_us: the longest duration with a bin of its own [us].
    """

    __slots__ = ("_counts", "_largest", "_limit")

    def __init__(self, limit_us: int = 100_000) -> None:
        if limit_us < 1:
            raise ValueError(f"limit_us must be at least 1 us, got {limit_us}")
        self._limit = limit_us
        self._counts = array("Q", bytes(8 * (limit_us + 2)))
        self._largest = -inf

    def add(self, us: float) -> None:
        """Count one duration [us]; a negative one counts as 0, one that is not a number as longer than the limit."""
        if us > self._largest:  # noqa: PLR1730 - half the cost of a call to max()
            self._largest = us
        self._counts[int(us + 0.5) if 0.0 <= us <= self._limit else self._edge(us)] += 1

    @property
    def count(self) -> int:
        return sum(self._counts)

    @property
    def max(self) -> float:
        """The largest duration added [us], not rounded; NaN if there is none."""
        return nan if self._largest == -inf else self._largest

    def percentile(self, p: float) -> float:
        """The nearest-rank percentile: the smallest bin with at least `p` percent of the durations in or below it.

        Args:
            p: percent, in [0, 100]; 0 gives the smallest bin in use.

        Returns:
            Microseconds, to the bin; `max` if the rank falls beyond the limit; NaN if nothing was added.

        Raises:
            ValueError: p is outside [0, 100].
        """
        if not 0.0 <= p <= 100.0:
            raise ValueError(f"p must be in [0, 100] percent, got {p}")
        # The last bit of a percentage must not move the rank: 4.4 percent of 750 is rank 33, not 34.
        rank = max(1, ceil(p * self.count / 100.0 * (1.0 - 1e-12)))
        below = 0
        for value, count in enumerate(self._counts):
            below += count
            if below >= rank:
                return self.max if value > self._limit else float(value)
        return nan

    def summary(self) -> dict[str, float]:
        """The percentiles that reports name, and the largest [us]."""
        return {name: self.percentile(p) for name, p in PERCENTILES.items()} | {"max": self.max}

    def merge(self, other: "Histogram") -> None:
        """Add the counts of another histogram of the same limit.

        Raises:
            ValueError: the limits differ.
        """
        if other._limit != self._limit:
            raise ValueError(f"cannot merge a histogram up to {other._limit} us into one up to {self._limit} us")
        for value, count in enumerate(other._counts):
            if count:
                self._counts[value] += count
        self._largest = max(self._largest, other._largest)

    def _edge(self, us: float) -> int:
        return 0 if us < 0.0 else self._limit + 1
