"""Exact percentiles of durations by nearest rank."""

from collections.abc import Mapping
from math import ceil

import numpy as np
from numpy.typing import ArrayLike, NDArray

Series = NDArray[np.float64]
Summary = dict[str, float | None]

PERCENTILES = {"p50": 50.0, "p90": 90.0, "p99": 99.0, "p99_9": 99.9}
NAMES = (*PERCENTILES, "max")


def percentile(ordered: Series, p: float) -> float:
    """The nearest-rank percentile: the smallest value that at least `p` percent of the values do not exceed.

    Args:
        ordered: ascending, at least one.
        p: percent, in (0, 100].
    """
    # Rounding must not move the rank: 4.4 percent of 750 is rank 33, not 34.
    rank = max(1, ceil(p * len(ordered) / 100.0 * (1.0 - 1e-12)))
    return float(ordered[rank - 1])


def summary(values: ArrayLike) -> Summary:
    """The percentiles of the reports and the maximum, in the unit of the values; None without values."""
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    if not len(ordered):
        return dict.fromkeys(NAMES)
    return {**{name: percentile(ordered, p) for name, p in PERCENTILES.items()}, "max": float(ordered[-1])}


def ratio(value: float | None, limit: float | None) -> float | None:
    """A value over its limit; None if either is unknown, or the limit is 0."""
    return None if value is None or not limit else value / limit


def ratios(values: Mapping[str, float | None], limits: Mapping[str, float | None]) -> Summary:
    return {name: ratio(values[name], limits[name]) for name in NAMES}
