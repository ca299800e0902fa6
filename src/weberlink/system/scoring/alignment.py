"""The felt error without the delay: what was felt against what the robot measured a lag before, at the best lag."""

from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

REACH_S = 1.0
"""Longest lag that is looked at [s]."""
MARGIN_S = 0.1
"""By which the lag may exceed the round trip [s]: look-ahead, play-out, and a robot that answers late."""


class AlignedError:
    """Mean squared error at every lag of whole ticks, from records of any number, in bounded memory.

    The sums over all pairs of a lag are correlations of both signals, of their squares, and of what counts. They are
    kept as a spectrum: samples fill a window, and each time that it is full one transform adds its inner part, which
    has every lag within it, to that.

    Args:
        period: of a tick [s].
        axes: of the signals.
        each: whether the error is that of the axis with the largest one; else the length of the vector.
    """

    def __init__(self, period: float, axes: int, *, each: bool = False) -> None:
        self._period, self._each = period, each
        self._reach = ceil(REACH_S / period)
        self._size = 1 << (4 * self._reach - 1).bit_length()
        self._step = self._size - 2 * self._reach
        self._window = np.zeros((2 * axes + 1, self._size))  # what counts, felt, robot
        self._spectrum = np.zeros((axes + 1, self._size // 2 + 1), complex)  # of the count, of the squares of each axis
        self._power = 0.0
        self._begin: int | None = None

    def add(self, ticks: NDArray[Any], felt: NDArray[Any], robot: NDArray[Any]) -> None:
        """Take the next moments that count.

        Args:
            ticks: numbers of the ticks, which rise until the side that counts them starts again, shape (n,).
            felt: what was displayed to the operator, shape (n, axes).
            robot: what the robot measured at the same moments, shape (n, axes).
        """
        ticks = ticks.astype(np.int64)
        rows = np.vstack([np.ones(len(ticks)), felt.T, robot.T])
        self._power += float(np.square(rows[1:]).sum())
        while len(ticks):
            self._reach_for(int(ticks[0]))
            places = ticks - self._begin
            outside = np.flatnonzero((places < 0) | (places >= self._size))
            count = int(outside[0]) if len(outside) else len(ticks)
            self._window[:, places[:count]] = rows[:, :count]
            ticks, rows = ticks[count:], rows[:, count:]

    def best(self, round_trip: float) -> tuple[float, float] | None:
        """The least RMS error, and its lag [s]: positive where the robot measured before it was felt.

        Args:
            round_trip: [s]; lags beyond it by more than a margin are chance.
        """
        sums = np.fft.irfft(self._spectrum + self._rest(), self._size)
        reach = min(self._reach, round((round_trip + MARGIN_S) / self._period))
        lags = np.array(sorted(range(-reach, reach + 1), key=abs))
        counts, squares = sums[0, lags], sums[1:, lags]
        if counts[0] < 1.0:
            return None
        means = np.maximum(squares, 0.0) / np.maximum(counts, 1.0)
        errors = np.where(counts > 0.5 * counts[0], means.sum(axis=0), np.inf)
        rounding = 1e-9 * self._power / counts[0]
        index = int(np.argmax(errors <= errors.min() + rounding))  # of lags that are alike, the smallest
        error = means[:, index].max() if self._each else errors[index]
        return float(error**0.5), float(lags[index]) * self._period

    def _reach_for(self, tick: int) -> None:
        """Move the window until it holds a tick."""
        if self._begin is None or not 0 <= tick - self._begin < 2 * self._size:
            self._spectrum += self._rest()
            self._window[:] = 0.0
            self._begin = tick - self._reach
        while tick - self._begin >= self._size:
            self._spectrum += self._inner(self._window)
            self._window = self._moved(self._window)
            self._begin += self._step

    def _rest(self) -> NDArray[np.complex128]:
        """What the samples in the window add, if no more follow."""
        return self._inner(self._window) + self._inner(self._moved(self._window))

    def _moved(self, window: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.hstack([window[:, self._step :], np.zeros((len(window), self._step))])

    def _inner(self, window: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Of what was felt in the inner part of a window, with all that the robot measured in it."""
        axes = len(window) // 2
        inner = np.zeros((axes + 1, self._size))
        chosen = slice(self._reach, self._reach + self._step)
        inner[:, chosen] = window[: axes + 1, chosen]
        felt, robot = inner[1:], window[axes + 1 :]
        ours = np.fft.rfft(np.vstack([inner, felt * felt]))
        theirs = np.conj(np.fft.rfft(np.vstack([window[:1], robot, robot * robot])))
        errors = (
            ours[axes + 1 :] * theirs[0]
            + ours[0] * theirs[axes + 1 :]
            - 2.0 * ours[1 : axes + 1] * theirs[1 : axes + 1]
        )
        return np.vstack([ours[:1] * theirs[:1], errors])
