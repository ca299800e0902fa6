"""Learns the near future of a signal from its recent past, by recursive least squares.

At tick k let X be a few numbers about the past of each axis: differences over 1 to 27 ms, distances from running means,
the motion of the hand and the value itself. For each of five horizons h, 4 to 64 ms, the displacement that follows is
estimated as

    f(k+h) - f(k) = w_h X + K_1 d + K_2 u (u d)

with weights w_h that are the same for all axes, and K_1 and K_2 that are the same for all horizons. d = p(k+h) - p(k)
is the motion that the receiver will know by then, and u is the direction of f(k). A second estimate has weights of its
own and K = 0; a signal without positions has only that one.

A sample counts by one over its squared deadband, and less if both estimates missed it by much (Cauchy weights). Each
state of the signal has its own estimates: free, loading and unloading.
"""

from math import exp
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.codec.predictors.contract import History, Signal
from weberlink.codec.predictors.path import HORIZONS, STEP_S
from weberlink.geometry.vector import ZERO, Vector, add, subtract

LAGS_S = (0.001, 0.003, 0.009, 0.027)
"""Times over which differences and, except the first, running means are taken [s]."""
MOTION_S = (0.004, 0.016)
"""Times over which the motion of the hand is taken [s]."""
STATE_S = 0.008
"""Time over which loading and unloading are told apart [s]."""
STEPS_PER_SOLUTION = 2
MEMORY_S = 10.0
"""Time constant of forgetting, counted in the time that the signal spends in a state [s]."""
RIDGE = 8.0
"""Weight of the prior assumption that nothing changes, in squared deadbands."""
ROBUST = 2.0
"""A sample that was missed by so many deadbands has half the weight."""
VALUE = 0.1
"""Scale of the value among the regressors."""
SMALLEST = 1e-280
"""A sample with a smaller squared deadband does not count: its weight could overflow."""
STATES = 3
"""Free, loading, unloading."""

_SLOTS = HORIZONS[-1] + 1
_AHEAD = np.array(HORIZONS)
_EACH = np.arange(len(HORIZONS))
_VALUE, _PLACE, _SUM, _WEIGHT = slice(0, 3), slice(3, 6), slice(6, 9), 9
"""Columns of a row: value, position, sum of all values before, 1 / squared deadband."""

Array = NDArray[np.float64]


class Learned(NamedTuple):
    """What is expected to follow a sample.

    Args:
        displacements: one for each horizon, in the unit of the values.
        stiffness: K_1 and K_2; 0 for the estimate without motion.
    """

    displacements: list[Vector]
    stiffness: tuple[float, float] = (0.0, 0.0)


class Slot:
    """Storage of the samples of the latest steps that are compared with what followed them; one index for each step."""

    def __init__(self, size: int) -> None:
        horizons = len(HORIZONS)
        self.regressors = np.zeros((_SLOTS, size, 3))
        self.rows = np.zeros((_SLOTS, 10))
        self.direction = np.zeros((_SLOTS, 3))
        self.state = np.zeros(_SLOTS, dtype=np.intp)
        self.expected = np.zeros((_SLOTS, 2, horizons, 3))
        self.stiffness = np.zeros((_SLOTS, 2))


class PathLearner:
    """The estimates of one signal.

    The work of a step is spread over its ticks: its largest part in one tick is one solution, of 5 systems of 10
    unknowns.

    Args:
        signal: what is known of the signal.
    """

    def __init__(self, signal: Signal) -> None:
        period = signal.grid.period
        lags = sorted({_ticks(lag, period) for lag in LAGS_S})
        motion = [_ticks(lag, period) for lag in MOTION_S] if signal.has_positions else []
        self._step = _ticks(STEP_S, period)
        self._threshold = signal.least_contact * signal.least_contact
        self._has_positions = signal.has_positions
        self._lags, self._motion = len(lags), len(motion)
        self._size = 2 * len(lags) + len(motion)
        self._kinds = 3 if signal.has_positions else 1
        self._offsets = np.array([*lags, *motion, _ticks(STATE_S, period)])
        self._forget = exp(-STEPS_PER_SOLUTION * self._step * period / MEMORY_S)
        self._kept = int(self._offsets.max()) + 1
        self._rows = np.zeros((4 * self._kept, 10))
        self._stages = (self._note, self._compare, self._add, self._solve)
        size, horizons = self._size, len(HORIZONS)
        self._slots = Slot(size)
        self._sums = np.zeros((STATES, horizons, size + self._kinds, size + self._kinds))
        self._weights = np.zeros((STATES, 2, horizons, size))
        self._stiffness = np.zeros((STATES, 2))
        self._parts = np.zeros((horizons, size + self._kinds, 3))
        self._begin()

    def _begin(self) -> None:
        self._last = -1
        self._total = ZERO
        self._ticks = self._steps = 0

    def follow(self, history: History) -> None:
        """Take in the newest sample. A gap in the samples ends the past, not the estimates."""
        if not history.follows:
            self._begin()
        square = history.bound * history.bound  # 0 for a tiny deadband too
        rows, last = self._rows, self._last
        if last + 1 == len(rows):
            rows[: self._kept] = rows[-self._kept :]
            last = self._kept - 1
            # The sums begin anew, so that they keep their digits.
            x, y, z = rows[last, _SUM].tolist()
            rows[: self._kept, _SUM] -= (x, y, z)
            self._total = subtract(self._total, (x, y, z))
        self._last = last = last + 1
        weight = 1.0 / square if square > SMALLEST else 0.0
        value, total = history.values[-1], self._total
        rows[last] = (*value, *history.places[-1], *total, weight)
        self._total = add(total, value)
        phase = self._ticks % self._step
        self._ticks += 1
        stages = self._stages[4 * phase // self._step : 4 * (phase + 1) // self._step]
        if stages:
            with np.errstate(all="ignore"):
                for stage in stages:
                    stage()

    def learned(self) -> tuple[Learned, ...]:
        """What is expected after the newest sample: with K = 0 and, if the signal has positions, with K."""
        with np.errstate(all="ignore"):
            regressors, state = self._look()
            expected = (self._weights[state] @ regressors).tolist()
        found = [Learned([tuple(each) for each in expected[0]])]
        if self._has_positions:
            along, normal = self._stiffness[state].tolist()
            found.append(Learned([tuple(each) for each in expected[1]], (along, normal)))
        return tuple(found)

    def _look(self) -> tuple[Array, int]:
        """The regressors of the newest sample (n, 3), and its state."""
        rows, last, lags, motion = self._rows, self._last, self._lags, self._motion
        at = np.maximum(last - self._offsets, 0)
        past, newest = rows[at], rows[last]
        value = newest[_VALUE]
        found = np.empty((self._size, 3))
        found[:lags] = value - past[:lags, _VALUE]
        counts = (last + 1.0 - at[1:lags])[:, None]
        found[lags : 2 * lags - 1] = value - (newest[_SUM] + value - past[1:lags, _SUM]) / counts
        found[-1] = VALUE * value
        if not motion:
            return found, 0
        place = newest[_PLACE]
        found[2 * lags - 1 : -1] = place - past[lags:-1, _PLACE]
        if value @ value < self._threshold:
            return found, 0
        return found, 1 if (place - past[-1, _PLACE]) @ value > 0.0 else 2

    def _note(self) -> None:
        """Store the newest sample and what is expected after it."""
        slots, slot = self._slots, self._steps % _SLOTS
        regressors, state = self._look()
        row = self._rows[self._last]
        slots.regressors[slot], slots.rows[slot], slots.state[slot] = regressors, row, state
        slots.expected[slot] = self._weights[state] @ regressors
        if self._has_positions:
            value = row[_VALUE]
            size = float(value @ value) ** 0.5
            slots.direction[slot] = value / size if size > 0.0 else 0.0
            slots.stiffness[slot] = self._stiffness[state]

    def _compare(self) -> None:
        """Compare the stored sample with what was expected of it, one horizon after another."""
        slots, slot = self._slots, self._steps % _SLOTS
        past = self._past()
        row, before = slots.rows[slot], slots.rows[past]
        known = len(past)
        size, parts = self._size, self._parts[:known]
        parts[:, :size] = slots.regressors[past]
        changes = parts[:, size:]
        changes[:, 0] = row[_VALUE] - before[:, _VALUE]
        expected = slots.expected[past, :, _EACH[:known]]
        missed = _squares(changes[:, 0] - expected[:, 0])
        if self._has_positions:
            direction, stiffness = slots.direction[past], slots.stiffness[past]
            changes[:, 1] = motion = row[_PLACE] - before[:, _PLACE]
            changes[:, 2] = direction * (direction * motion).sum(axis=1)[:, None]
            by_motion = stiffness[:, :1] * changes[:, 1] + stiffness[:, 1:] * changes[:, 2]
            missed = np.minimum(missed, _squares(changes[:, 0] - expected[:, 1] - by_motion))
        weights = before[:, _WEIGHT]
        self._counts = weights / (1.0 + missed * weights / (ROBUST * ROBUST))

    def _add(self) -> None:
        """Add the compared samples to the sums."""
        past = self._past()
        parts = self._parts[: len(past)]
        products = (parts * self._counts[:, None, None]) @ parts.transpose(0, 2, 1)
        self._sums[self._slots.state[past], _EACH[: len(past)]] += products
        self._steps += 1

    def _past(self) -> NDArray[np.intp]:
        """The slots of the samples that one horizon after another ends at the stored one."""
        return ((self._steps - _AHEAD[: np.searchsorted(_AHEAD, self._steps, side="right")]) % _SLOTS).astype(np.intp)

    def _solve(self) -> None:
        """Solve for the weights of the present state."""
        if self._steps % STEPS_PER_SOLUTION:
            return
        state, size = int(self._slots.state[(self._steps - 1) % _SLOTS]), self._size
        sums = self._sums[state]
        sums *= self._forget
        left, right = sums[:, :size, :size].copy(), sums[:, :size, size:]
        ridge = np.full(size, RIDGE)
        scale = 0.0
        if self._has_positions:
            own, moved = sums[:, size, size].sum(), sums[:, size + 1, size + 1].sum()
            scale = moved / own if own > 0.0 else 0.0
            ridge[2 * self._lags - 1 : -1] *= scale if scale > 0.0 else 1.0  # not singular for a hand at rest
        left[:, np.arange(size), np.arange(size)] += ridge
        try:
            found = np.linalg.solve(left, right)
            path = found[:, :, 0]
            joint, stiffness = path, np.zeros(2)
            if scale > 0.0:
                rest = (sums[:, size:, size:] - right.transpose(0, 2, 1) @ found).sum(axis=0)
                stiffness = np.linalg.solve(rest[1:, 1:] + RIDGE * scale * np.eye(2), rest[1:, 0])
                joint = path - found[:, :, 1:] @ stiffness
        except np.linalg.LinAlgError:
            path = joint = stiffness = np.array(np.nan)
        if not (np.isfinite(path).all() and np.isfinite(joint).all() and np.isfinite(stiffness).all()):
            path = joint = stiffness = np.array(0.0)
            sums[:] = 0.0
        self._weights[state, 0], self._weights[state, 1], self._stiffness[state] = path, joint, stiffness


def _squares(vectors: Array) -> Array:
    squares: Array = (vectors * vectors).sum(axis=1)
    return squares


def _ticks(seconds: float, period: float) -> int:
    return max(1, round(seconds / period))
