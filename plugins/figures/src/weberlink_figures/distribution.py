"""Percentiles of any number of durations in bounded memory.

Bins grow by 0.5 % each, so percentiles are accurate to 0.5 % from 1 us to 10 minutes.
"""

from math import inf, log, nan

import numpy as np
from numpy.typing import ArrayLike

from weberlink_figures.tree import Median, Spread

RESOLUTION = 0.005
SMALLEST_US = 1.0
LARGEST_US = 6e8

_LOG_STEP = log(1.0 + RESOLUTION)
_BINS = int(log(LARGEST_US / SMALLEST_US) / _LOG_STEP) + 2


class Distribution:
    """Histogram of durations [us]; those below 1 us share a bin with the value 0."""

    def __init__(self) -> None:
        self._counts = np.zeros(_BINS, dtype=np.int64)
        self._largest = -inf

    def add(self, us: ArrayLike) -> None:
        """Count durations [us], shape (n,); non-finite ones are ignored."""
        values = np.asarray(us, dtype=np.float64)
        values = values[np.isfinite(values)]
        if not len(values):
            return
        self._largest = max(self._largest, float(values.max()))
        clipped = np.clip(values, SMALLEST_US, LARGEST_US)
        bins = np.where(values < SMALLEST_US, 0, 1 + (np.log(clipped / SMALLEST_US) / _LOG_STEP).astype(np.int64))
        self._counts += np.bincount(bins, minlength=_BINS)

    @property
    def count(self) -> int:
        return int(self._counts.sum())

    @property
    def max(self) -> float:
        """The largest duration [us], exact; NaN if there is none."""
        return nan if self._largest == -inf else self._largest

    def percentile(self, p: float) -> float:
        """The percentile `p` [us] to the resolution of a bin; NaN if nothing was added."""
        cumulative = np.cumsum(self._counts)
        if not cumulative[-1]:
            return nan
        rank = max(1.0, p / 100.0 * float(cumulative[-1]))
        bin_ = int(np.searchsorted(cumulative, rank - 1e-9 * rank))
        if bin_ == 0:
            return 0.0
        return min(self._largest, SMALLEST_US * float(np.exp((bin_ - 0.5) * _LOG_STEP)))

    def median(self) -> Median:
        """Median and 99th percentile [us]."""
        return Median(self.percentile(50.0), self.percentile(99.0)) if self.count else Median()

    def spread(self) -> Spread:
        """The reported percentiles, and the largest duration [us]."""
        if not self.count:
            return Spread()
        return Spread(self.percentile(50.0), self.percentile(99.0), self.percentile(99.9), self.max)
