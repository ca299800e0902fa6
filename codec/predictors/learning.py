"""Learns the near future of a signal from its recent past, by recursive least squares.

At tick k let X be a few numbers about the past of each axis: differences over 1 to 27 ms, distances from running means,
the motion of the hand and the value itself. For each of six horizons h, 4 to 128 ms, the displacement that follows is
estimated as

    f(k+h) - f(k) = w_h X + K_1 d + K_2 u (u d)

with weights w_h that are the same for all axes, and K_1 and K_2 that are the same for all horizons. d = p(k+h) - p(k)
is the motion that the receiver will know by then, and u is the direction of f(k). A second estimate has weights of its
own and K = 0; a signal without positions has only that one.

A sample counts by one over its squared deadband, and less if both estimates missed it by much (Cauchy weights). Each
state of the signal has its own estimates: free, loading and unloading.
"""

from math import exp, isnan, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.codec.predictors.estimation import History, Signal
from weberlink.codec.predictors.path import HORIZONS, STEP_S
from weberlink.geometry.vector import ZERO, Vector, add, dot, subtract

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

_IDENTITY = np.eye(2)

Array = NDArray[np.float64]
Displacements = list[list[list[float]]]
"""By estimate, horizon and axis."""


class Learned(NamedTuple):
    """What is expected to follow a sample: a displacement for each horizon, and K_1 and K_2."""

    displacements: list[Vector]
    stiffness: tuple[float, float] = (0.0, 0.0)


class Noted:
    """A sample that is compared with what follows it; `expected` are displacements by estimate, horizon and axis."""

    __slots__ = ("direction", "expected", "place", "state", "stiffness", "value", "weight")

    def __init__(
        self,
        value: Vector,
        place: Vector,
        weight: float,
        state: int,
        expected: Displacements,
        stiffness: tuple[float, float],
    ) -> None:
        self.value = value
        self.place = place
        size = sqrt(dot(value, value))
        self.direction = (value[0] / size, value[1] / size, value[2] / size) if size > 0.0 else ZERO
        self.weight = weight
        self.state = state
        self.expected = expected
        self.stiffness = stiffness


class PathLearner:
    """The estimates of one signal.

    The work of a step is spread over its ticks: its largest part in one tick is one solution, of 6 systems of 10
    unknowns. Sums and weights are changed in the tick that needs them, so a gap between two ticks leaves them whole.
    """

    def __init__(self, signal: Signal) -> None:
        period = signal.grid.period
        self._lags = sorted({_ticks(lag, period) for lag in LAGS_S})
        self._motion = [_ticks(lag, period) for lag in MOTION_S] if signal.has_positions else []
        self._turn = _ticks(STATE_S, period)
        self._step = _ticks(STEP_S, period)
        self._threshold = signal.least_contact * signal.least_contact
        self._has_positions = signal.has_positions
        self._forget = exp(-STEPS_PER_SOLUTION * self._step * period / MEMORY_S)
        self._kept = max(*self._lags, *self._motion, self._turn) + 1
        self._stages = (self._note, self._compare, self._add, self._renew)
        self._size = size = 2 * len(self._lags) + len(self._motion)
        horizons, estimates, kinds = len(HORIZONS), 1 + signal.has_positions, 3 if signal.has_positions else 1
        self._weights = np.zeros((STATES, estimates, horizons, size))
        self._stiffness = [(0.0, 0.0)] * STATES
        self._sums = np.zeros((STATES, horizons, size + kinds, size + kinds))
        # By slot: a sample and, for the sums, its regressors; after them there is room for the changes that followed.
        nothing = [[[0.0, 0.0, 0.0]] * horizons] * estimates
        self._noted = [Noted(ZERO, ZERO, 0.0, 0, nothing, (0.0, 0.0)) for _ in range(_SLOTS)]
        self._regressors = np.zeros((_SLOTS, 3 * (size + kinds)))
        self._past = [np.array([(slot - steps) % _SLOTS for steps in HORIZONS]) for slot in range(_SLOTS)]
        # Of the samples that are compared: regressors and changes, the changes and the factor in the sums, products.
        self._rows = np.zeros((horizons, 3 * (size + kinds)))
        self._parts = self._rows.reshape(horizons, size + kinds, 3)
        self._changes = np.zeros(horizons * (3 * kinds + 1))
        self._weighted = np.zeros((horizons, size + kinds, 3))
        self._products = np.zeros_like(self._sums[0])
        # Of a solution: sums, those of squared changes of value and place, left sides, their diagonals and what is
        # added there, results.
        self._staged = np.zeros_like(self._sums[0])
        count = size + kinds
        self._squares = self._staged.reshape(horizons, count * count)[:, size * (count + 1) :: count + 1][:, :2]
        self._left = np.zeros((horizons, size, size))
        self._diagonals = self._left.reshape(horizons, size * size)[:, :: size + 1]
        self._ridge = np.full(size, RIDGE)
        self._scale = 0.0
        self._found: Array | None = None
        self._renewed = np.zeros_like(self._weights[0])
        self._begin()

    def _begin(self) -> None:
        self._totals: list[Vector] = []
        self._total = ZERO
        self._ticks = self._steps = self._known = 0

    def follow(self, history: History) -> None:
        """Take in the newest sample. A gap in the samples ends the past, not the estimates."""
        if not history.follows:
            self._begin()
        self._values, self._places, self._bound = history.values, history.places, history.bound
        self._newest: tuple[Array, int, Displacements] | None = None
        self._learned: tuple[Learned, ...] | None = None
        if len(self._totals) == 4 * self._kept:
            # The sums begin anew, so that they keep their digits.
            start = self._totals[-1]
            self._totals = [subtract(each, start) for each in self._totals[-self._kept :]]
            self._total = subtract(self._total, start)
        self._totals.append(self._total)
        self._total = add(self._total, self._values[-1])
        phase = self._ticks % self._step
        self._ticks += 1
        first, last = 4 * phase // self._step, 4 * (phase + 1) // self._step
        if first < last:
            with np.errstate(all="ignore"):
                for stage in self._stages[first:last]:
                    stage()

    def learned(self) -> tuple[Learned, ...]:
        """What is expected after the newest sample: with K = 0 and, if the signal has positions, with K."""
        if self._learned is None:
            with np.errstate(all="ignore"):
                _, state, expected = self._expect()
            paths = [[(x, y, z) for x, y, z in path] for path in expected]
            stiffness = ((0.0, 0.0), self._stiffness[state])
            self._learned = tuple([Learned(path, stiffness[index]) for index, path in enumerate(paths)])
        return self._learned

    def _look(self) -> tuple[list[float], int]:
        """The regressors of the newest sample, three numbers each, and its state."""
        values, totals, oldest = self._values, self._totals, len(self._totals) - 1
        x, y, z = values[-1]
        found: list[float] = []
        for lag in self._lags:
            a, b, c = values[-1 - min(lag, oldest)]
            found += (x - a, y - b, z - c)
        u, v, w = totals[-1]
        for lag in self._lags[1:]:
            back = min(lag, oldest)
            a, b, c = totals[-1 - back]
            count = back + 1.0
            found += (x - (u + x - a) / count, y - (v + y - b) / count, z - (w + z - c) / count)
        state = 0
        if self._has_positions:
            places = self._places
            u, v, w = places[-1]
            for lag in self._motion:
                a, b, c = places[-1 - min(lag, oldest)]
                found += (u - a, v - b, w - c)
            if not x * x + y * y + z * z < self._threshold:
                a, b, c = places[-1 - min(self._turn, oldest)]
                state = 1 if (u - a) * x + (v - b) * y + (w - c) * z > 0.0 else 2
        found += (VALUE * x, VALUE * y, VALUE * z)
        return found, state

    def _expect(self) -> tuple[Array, int, Displacements]:
        """The regressors of the newest sample, its state, and what each estimate expects after it."""
        if self._newest is None:
            found, state = self._look()
            regressors = np.array(found)
            expected = (self._weights[state] @ regressors.reshape(self._size, 3)).tolist()
            self._newest = regressors, state, expected
        return self._newest

    def _note(self) -> None:
        """Store the newest sample and what is expected after it."""
        regressors, state, expected = self._expect()
        slot = self._steps % _SLOTS
        self._regressors[slot, : len(regressors)] = regressors
        square = self._bound * self._bound  # 0 for a tiny deadband too
        weight = 1.0 / square if square > SMALLEST else 0.0
        value, place, stiffness = self._values[-1], self._places[-1], self._stiffness[state]
        self._noted[slot] = Noted(value, place, weight, state, expected, stiffness)

    def _compare(self) -> None:
        """Compare the stored sample with what was expected of it, one horizon after another."""
        steps, noted = self._steps, self._noted
        now = noted[steps % _SLOTS]
        while self._known < len(HORIZONS) and HORIZONS[self._known] <= steps:
            self._known += 1
        known = self._known
        (f, g, h), (p, q, r) = now.value, now.place
        changes: list[float] = []
        for index in range(known):
            before = noted[(steps - HORIZONS[index]) % _SLOTS]
            x, y, z = before.value
            x, y, z = f - x, g - y, h - z
            changes += (x, y, z)
            a, b, c = before.expected[0][index]
            missed = _square(x - a, y - b, z - c)
            if self._has_positions:
                u, v, w = before.place
                u, v, w = p - u, q - v, r - w
                a, b, c = before.direction
                pressed = a * u + b * v + c * w
                a, b, c = a * pressed, b * pressed, c * pressed
                changes += (u, v, w, a, b, c)
                along, normal = before.stiffness
                u, v, w = along * u + normal * a, along * v + normal * b, along * w + normal * c
                a, b, c = before.expected[1][index]
                other = _square(x - a - u, y - b - v, z - c - w)
                if other < missed or isnan(other):
                    missed = other
            weight = before.weight
            changes.append(weight / (1.0 + missed * weight / (ROBUST * ROBUST)))
        self._regressors.take(self._past[steps % _SLOTS], 0, self._rows, "clip")
        self._changes[: len(changes)] = changes
        table = self._changes.reshape(len(HORIZONS), -1)
        self._rows[:, 3 * self._size :] = table[:, :-1]
        parts = self._parts[:known]
        weighted = np.multiply(parts, table[:known, -1, None, None], self._weighted[:known])
        np.matmul(weighted, parts.transpose(0, 2, 1), self._products[:known])

    def _add(self) -> None:
        """Add the compared samples to the sums, and solve for the weights of the present state."""
        steps, noted, known = self._steps, self._noted, self._known
        self._steps = steps + 1
        states = [noted[(steps - HORIZONS[index]) % _SLOTS].state for index in range(known)]
        first = 0
        for after in range(1, known + 1):
            if after == known or states[after] != states[first]:
                sums = self._sums[states[first], first:after]
                np.add(sums, self._products[first:after], sums)
                first = after
        if self._steps % STEPS_PER_SOLUTION == 0:
            self._solve(noted[steps % _SLOTS].state)

    def _solve(self, state: int) -> None:
        """Solve for the weights of a state. Nothing is changed before `_renew`."""
        size, left = self._size, self._left
        sums = np.multiply(self._sums[state], self._forget, self._staged)
        left[:] = sums[:, :size, :size]
        self._scale = scale = 0.0
        if self._has_positions:
            own = moved = 0.0
            for of_value, of_place in self._squares.tolist():
                own += of_value
                moved += of_place
            self._scale = scale = moved / own if own > 0.0 else 0.0
            self._ridge[2 * len(self._lags) - 1 : -1] = RIDGE * (scale if scale > 0.0 else 1.0)
        np.add(self._diagonals, self._ridge, self._diagonals)
        try:
            self._found = np.linalg.solve(left, sums[:, :size, size:])
        except np.linalg.LinAlgError:
            self._found = None

    def _renew(self) -> None:
        """Take over a solution."""
        if self._steps % STEPS_PER_SOLUTION:
            return
        state, size, found = self._noted[(self._steps - 1) % _SLOTS].state, self._size, self._found
        sums, weights, scale = self._staged, self._renewed, self._scale
        stiffness = np.zeros(2)
        try:
            if found is None:
                weights[:] = np.nan
            else:
                weights[:] = path = found[:, :, 0]
                if scale > 0.0:
                    rest = (sums[:, size:, size:] - sums[:, :size, size:].transpose(0, 2, 1) @ found).sum(axis=0)
                    stiffness = np.linalg.solve(rest[1:, 1:] + RIDGE * scale * _IDENTITY, rest[1:, 0])
                    np.subtract(path, found[:, :, 1:] @ stiffness, weights[1])
        except np.linalg.LinAlgError:
            weights[:] = np.nan
        if not np.isfinite(weights).all():  # nor is a stiffness then
            sums[:] = weights[:] = stiffness[:] = 0.0
        along, normal = stiffness.tolist()
        self._sums[state], self._weights[state], self._stiffness[state] = sums, weights, (along, normal)
        self._newest = self._learned = None


def _square(x: float, y: float, z: float) -> float:
    return x * x + y * y + z * z


def _ticks(seconds: float, period: float) -> int:
    return max(1, round(seconds / period))
