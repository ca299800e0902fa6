"""Measures of quality: errors and jumps of the displayed force in just noticeable differences (JND) of a person.

They depend on what was displayed and on what was measured, not on the codec or its deadband, and they are derived from
Weber's law: none of them is a rating of a person (`weberlink study experiment`). The perceptual indices of the
literature (HSSIM and others) are not implemented: their formulas could not be verified.
"""

from dataclasses import dataclass
from math import ceil, log
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weberlink.telemetry.reader import Records
from weberlink.telemetry.record import FORCE
from weberlink_figures.channel import Exceedances, distances, in_session
from weberlink_figures.distribution import Distribution
from weberlink_figures.tree import Quality

Array = NDArray[np.float64]

REACH_S = 1.0  # longest lag that is looked at [s]
MARGIN_S = 0.1  # by which the lag may exceed the round trip [s]: look-ahead, play-out, and a robot that answers late


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
        """Take the next moments that count: ticks, shape (n,), that rise until the side that counts them starts again;
        what was displayed to the operator and what the robot measured, shape (n, axes).
        """
        ticks = ticks.astype(np.int64)
        rows = np.vstack([np.ones(len(ticks)), felt.T, robot.T])
        self._power += float(np.square(rows[1:]).sum())
        while len(ticks):
            self._move_to(int(ticks[0]))
            places = ticks - self._begin
            outside = np.flatnonzero((places < 0) | (places >= self._size))
            count = int(outside[0]) if len(outside) else len(ticks)
            self._window[:, places[:count]] = rows[:, :count]
            ticks, rows = ticks[count:], rows[:, count:]

    def best(self, round_trip: float) -> tuple[float, float] | None:
        """The least RMS error, and its lag [s]: positive where the robot measured before it was felt.

        Lags beyond the round trip [s] by more than a margin are chance.
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

    def _move_to(self, tick: int) -> None:
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

    def _moved(self, window: Array) -> Array:
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


WEBER_FRACTION = 0.10
"""JND of force as a share of the force: 0.07 between thumb and forefinger from 2.5 to 10 N (Pang, Tan and Durlach,
Perception and Psychophysics 49, 1991); 0.11 for the wrist, 0.13 for the elbow and 0.08 for the shoulder (Feyzabadi and
others, IEEE Transactions on Haptics 6(3), 309-319, 2013)."""
ABSOLUTE_THRESHOLD_N = 0.04
"""The smallest force that is noticed [N]: mean over wrist, elbow and shoulder (Feyzabadi and others, 2013)."""
_PER_JND = 1e4  # a `Distribution` resolves numbers from 1 to 6e8; so jumps are resolved from 1e-4 to 6e4 JND


@dataclass(frozen=True)
class Threshold:
    """A just noticeable difference of force; ValueError for a number out of range.

    Args:
        jnd: Weber fraction k_J, as a share of the force, > 0.
        floor_n: absolute threshold [N], > 0; Weber's law fails below about 1 N.
    """

    jnd: float = WEBER_FRACTION
    floor_n: float = ABSOLUTE_THRESHOLD_N

    def __post_init__(self) -> None:
        if not (0.0 < self.jnd < np.inf and 0.0 < self.floor_n < np.inf):
            raise ValueError(f"jnd and floor_n must be > 0 and finite, not {self.jnd!r} and {self.floor_n!r}")

    def at(self, magnitude_n: Any) -> Array:
        """One JND [N], `max(jnd |f|, floor_n)`, at magnitudes of forces [N], shape (n,)."""
        return np.maximum(self.jnd * np.asarray(magnitude_n, dtype=np.float64), self.floor_n)

    def log_error(self, displayed_n: Array, measured_n: Array) -> Array:
        """The log error [JND]: the number of JNDs, one upon the other, between two magnitudes of force [N], shape (n,).

        `|ln((|f| + f0) / (|f'| + f0))| / ln(1 + k_J)`, from Weber's law with an additive constant, one JND =
        k_J (|f| + f0). f0 = floor_n / k_J, so that one JND at zero force is the absolute threshold. Unlike the error in
        multiples of one JND it counts a force that is displayed k times too strong as one that is k times too weak. It
        does not see the direction.
        """
        offset = self.floor_n / self.jnd
        ratio = np.log((measured_n + offset) / (displayed_n + offset))
        return np.asarray(np.abs(ratio) / log(1.0 + self.jnd), dtype=np.float64)


class QualityStatistics:
    """Running measures of a displayed force, in bounded memory."""

    def __init__(self, period_s: float, threshold: Threshold | None = None) -> None:
        self._period_s = period_s
        self._threshold = threshold or Threshold()
        self._errors, self._log_errors = Exceedances(), Exceedances()
        self._jumps = Distribution()

    def add(self, error_n: Array, displayed_n: Array, measured_n: Array) -> None:
        """Take the next ticks, in order: distances of the displayed force from the measured one, and the magnitudes of
        both [N], shape (n,).
        """
        threshold_n = self._threshold.at(measured_n)
        noticed = error_n > threshold_n
        self._errors.add(error_n / threshold_n, noticed)
        self._log_errors.add(self._threshold.log_error(displayed_n, measured_n), noticed)

    def add_jumps(self, jump_n: Array, before_n: Array) -> None:
        """Take jumps: changes of the displayed force from one tick to the next, in a tick with an update [N].

        A jump is in JNDs of the magnitude of the force displayed before it [N], with which a person compares it.
        """
        self._jumps.add(jump_n / self._threshold.at(before_n) * _PER_JND)

    def figures(self) -> Quality:
        """All measures; None before the first tick, or the first jump."""
        jumps: dict[str, float] = {}
        if self._jumps.count:
            shares = (self._jumps.percentile(50.0), self._jumps.percentile(99.0), self._jumps.max)
            named = zip(("median", "p99", "max"), shares, strict=True)
            jumps = {f"jump_{name}_jnd": value / _PER_JND for name, value in named}
        errors, logs = self._errors, self._log_errors
        if not errors.count:
            return Quality(**jumps)
        return Quality(
            error_rms_jnd=errors.rms,
            error_max_jnd=errors.largest,
            noticeable_fraction=errors.beyond / errors.count,
            noticeable_longest_s=errors.longest_run * self._period_s,
            log_error_rms_jnd=logs.rms,
            log_error_max_jnd=logs.largest,
            **jumps,
        )


class JumpsOfRecords:
    """Jumps in the records of the operator's side, which come in pieces."""

    def __init__(self) -> None:
        self._last: Records | None = None

    def of(self, master: Records) -> tuple[Array, Array]:
        """Changes of the force commanded to the device [N] and magnitudes of the force before [N], shape (m,) each.

        Of two ticks in session, one after the other, the second with an update.
        """
        joined = master if self._last is None else np.concatenate([self._last, master])
        if len(master):
            self._last = master[-1:].copy()
        before, after = joined[:-1], joined[1:]
        counts = in_session(before) & in_session(after) & (after["received"] > 0)
        counts &= np.diff(joined["tick"].astype(np.int64)) == 1
        held, displayed = (records["output"][counts, FORCE] for records in (before, after))
        return distances(displayed, held), np.linalg.norm(held, axis=1)
