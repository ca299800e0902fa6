"""How far a stretch from each tick can reach, for families with one free number that pairs of ticks confine.

The number is the slope of a line or the stiffness of a surface. Every two ticks leave it an interval; a stretch can be
explained while the intervals of all its pairs intersect. The intersection for the ticks a to a+d is that of a to a+d-1,
of a+1 to a+d and of the pair (a, a+d), so all stretches of a length follow from those one tick shorter.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ticks = NDArray[np.int64]
Index = Ticks | slice
Pair = Callable[[Index, Index, int], tuple[Array, Array]]
"""Maps earlier ticks, later ticks and their distance to the ends of the intervals, each of shape (rows, ticks)."""

DENSE = 0.8
"""Ended stretches are removed when fewer than this share continues."""


def reaches(low: Array, high: Array, pair: Pair, *, jointly: bool, resolution: int) -> Ticks:
    """The first tick that a stretch from each tick cannot include, or a later one.

    Rows are separate numbers with their own intervals. From a distance of twice `resolution` on, stretches begin and
    end on a grid of time whose step doubles with the distance. A long stretch may then seem longer than it is, never
    shorter.

    Args:
        low: smallest number that each tick by itself allows, shape (rows, n).
        high: the largest, likewise.
        pair: the intervals of pairs.
        jointly: whether a stretch ends with the first row that fails; else every row has its own.
        resolution: at least 1; n / 2 or more compares all pairs.

    Returns:
        Shape (rows, n), or (1, n) if jointly; each at least its tick + 1, at most n, and not decreasing.
    """
    ticks = low.shape[1]
    starts = np.arange(ticks)
    reach = np.full((1 if jointly else len(low), ticks), ticks)
    alive = np.ones(reach.shape, dtype=bool)
    span = np.zeros_like(reach)
    distance, step = 0, 1
    while starts.size:
        if distance // resolution >= 2 * step:
            step *= 2
            kept = np.flatnonzero(starts % step == 0)
            _end(reach, starts, span, ~alive)
            starts, low, high, span, alive = _take(kept, starts, low, high, span, alive)
        distance += step
        np.copyto(span, distance, where=alive)
        _end(reach, starts[-1:], span[:, -1:], ~alive[:, -1:])
        # Where neighbours in the list are further apart, the stretches between them have ended, and so have those that
        # include them; their intervals do not matter any more.
        starts, span = starts[:-1], span[:, :-1]
        if not starts.size:
            break
        low, high = np.maximum(low[:, :-1], low[:, 1:]), np.minimum(high[:, :-1], high[:, 1:])
        pair_low, pair_high = pair(*_indices(starts, distance, step), distance)
        np.maximum(low, pair_low, out=low)
        np.minimum(high, pair_high, out=high)
        alive = low <= high
        if jointly:
            alive = np.logical_and.reduce(alive, axis=0, keepdims=True)
        living = alive.any(axis=0)
        if np.count_nonzero(living) < DENSE * starts.size:
            _end(reach, starts, span, ~alive)
            starts, low, high, span, alive = _take(np.flatnonzero(living), starts, low, high, span, alive)
    # A stretch reaches no further than one that begins later.
    return np.minimum.accumulate(reach[:, ::-1], axis=1)[:, ::-1]


def _end(reach: Ticks, starts: Ticks, span: Ticks, ended: NDArray[np.bool_]) -> None:
    """Store the reach of the stretches that have ended."""
    for row, spans, over in zip(reach, span, ended, strict=True):
        row[starts[over]] = starts[over] + spans[over]


def _take(kept: Ticks, starts: Ticks, *arrays: Any) -> tuple[Any, ...]:
    return (starts[kept], *(array.take(kept, axis=1) for array in arrays))


def _indices(starts: Ticks, distance: int, step: int) -> tuple[Index, Index]:
    """Indices as slices where possible, which copy nothing."""
    first, last = int(starts[0]), int(starts[-1])
    if last - first == (len(starts) - 1) * step:
        return slice(first, last + 1, step), slice(first + distance, last + 1 + distance, step)
    return starts, starts + distance
