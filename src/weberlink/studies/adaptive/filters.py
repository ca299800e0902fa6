"""Recomputes the filters of `weberlink.codec.predictors.trend` from recorded signals by weighted least squares.

The regression predicts the future of a tick (its mean over a horizon, or the line through it), relative to the newest
sample, from the differences of the newest sample to earlier ones. All axes share one filter, so that it turns with the
signal. Errors count in deadbands, and each signal counts alike, however long it is. Ticks after which the signal leaves
three deadbands are left out: no linear filter can predict the begin or end of a contact.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.codec.predictors.trend import LAGS

Array = NDArray[np.float64]

WEBER, FLOOR_N = 0.10, 0.05
"""Deadband in which errors count."""
FARTHEST = 3.0
"""[deadbands]."""
BEGIN = 100
"""First ticks of each signal, left out so that all lags reach back to samples."""
HOLD_TICKS, LINE_TICKS = 20, 40
"""Horizons of the filters that the codec uses."""

Filter = tuple[float, ...]


class Filters(NamedTuple):
    """Weights of the differences, in the order of `LAGS`."""

    hold: Filter
    """Mean of the next `HOLD_TICKS`."""
    line: Filter
    """Value of the line through the next `LINE_TICKS`."""
    slope: Filter
    """Its slope, per tick."""


def filters(forces: Iterable[Array]) -> Filters:
    """Learn the filters from recorded forces, each of shape (n, 3) [N] with at least 142 samples.

    Raises:
        ValueError: if no signal is long enough.
    """
    signals = list(forces)
    (hold,) = _regressed(signals, np.full((1, HOLD_TICKS), 1.0 / HOLD_TICKS))
    ahead = np.arange(1.0, LINE_TICKS + 1.0)
    value, slope = _regressed(signals, np.linalg.pinv(np.column_stack([np.ones(LINE_TICKS), ahead])))
    return Filters(hold, value, slope)


def _regressed(signals: list[Array], targets: Array) -> list[Filter]:
    """A filter for each row of `targets`, which are weights of the next samples, shape (filters, horizon)."""
    rows = [_rows(force, targets) for force in signals]
    left, right = (np.concatenate(parts) for parts in zip(*rows, strict=True)) if rows else (np.empty(0), np.empty(0))
    if not len(left):
        raise ValueError("no signal is long enough to learn a filter from")
    solution = np.linalg.lstsq(left, right, rcond=None)[0]
    return [tuple(column) for column in solution.T.tolist()]


def _rows(force: Array, targets: Array) -> tuple[Array, Array]:
    """Equations of one signal, weighted: differences, shape (m, lags), and targets, shape (m, filters)."""
    horizon = targets.shape[1]
    ticks = np.arange(BEGIN, len(force) - horizon - 1)
    if not len(ticks):
        return np.empty((0, len(LAGS))), np.empty((0, len(targets)))
    here = force[ticks]
    windows = np.lib.stride_tricks.sliding_window_view(force[1:], horizon, axis=0)[ticks] - here[:, :, None]
    bound = np.maximum(WEBER * np.linalg.norm(here, axis=1), FLOOR_N)
    near = np.abs(windows).max(axis=(1, 2)) < FARTHEST * bound
    weight = (near / (bound * np.sqrt(len(force))))[:, None, None]
    differences = np.stack([here - force[ticks - lag] for lag in LAGS], axis=-1)
    wanted = windows @ targets.T
    return (differences * weight).reshape(-1, len(LAGS)), (wanted * weight).reshape(-1, len(targets))
