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

from math import exp, isfinite, isnan, sqrt
from typing import NamedTuple

from weberlink.geometry.vector import ZERO, Vector, add, dot, subtract
from weberlink_predictors.estimation import History, Signal
from weberlink_predictors.path import HORIZONS, STEP_S

LAGS_S = (0.001, 0.003, 0.009, 0.027)  # Times over which differences and, except the first, running means are taken [s]
MOTION_S = (0.004, 0.016)  # Times over which the motion of the hand is taken [s]
STATE_S = 0.008  # Time over which loading and unloading are told apart [s]
MEMORY_S = 10.0  # Time constant of forgetting, counted in the time that the signal spends in a state [s]
RIDGE = 8.0  # Weight of the prior assumption that nothing changes, in squared deadbands
ROBUST = 2.0  # A sample that was missed by so many deadbands has half the weight
VALUE = 0.1  # Scale of the value among the regressors
SMALLEST = 1e-280  # A sample with a smaller squared deadband does not count: its weight could overflow
STATES = 3  # Free, loading, unloading

_SLOTS = HORIZONS[-1] + 1
_NOTE, _SOLVE = -1, -2
_WORK = (_NOTE, 0, _SOLVE, 1, 2, _SOLVE, 3, 4, _SOLVE, 5)  # A step: store a sample, compare each horizon, solve thrice
_STILL = (0.0, 0.0)

Row = list[float]


class Learned(NamedTuple):
    """What is expected to follow a sample: a displacement for each horizon, and K_1 and K_2."""

    displacements: list[Vector]
    stiffness: tuple[float, float] = _STILL


class Equations:
    """The least squares of one horizon: sums of products, and what follows from them.

    A row has the products of one regressor with those up to itself; the rows after them those of the changes, by kind,
    with the regressors and with each other. The kinds are the change of the value and, where there are positions, d and
    u (u d). As the sums forget, they forget their rounding errors too, and the ridge keeps them positive definite.
    """

    __slots__ = ("rows", "solutions", "unexplained")

    def __init__(self, size: int, kinds: int) -> None:
        self.rows: list[Row] = [[0.0] * (index + 1) for index in range(size + kinds)]
        self.solutions: list[Row] = []  # The weights that explain each kind of change
        self.unexplained: list[Row] = []  # Products of the changes with each other, of what the weights leave of them

    def add(self, noted: "Noted", changes: list[Vector], weight: float, forget: float) -> None:
        """Add a sample and what followed it."""
        rows, size = self.rows, len(noted.squares)
        for index in range(size):
            rows[index] = [forget * old + weight * new for old, new in zip(rows[index], noted.squares[index])]  # noqa: B905 - strict costs
        xs, ys, zs = [*noted.xs], [*noted.ys], [*noted.zs]
        for kind in range(len(changes)):
            x, y, z = changes[kind]
            xs.append(x)
            ys.append(y)
            zs.append(z)
            x, y, z = weight * x, weight * y, weight * z
            row = rows[size + kind]
            rows[size + kind] = [forget * old + (x * a + y * b + z * c) for old, a, b, c in zip(row, xs, ys, zs)]  # noqa: B905 - as above

    def solve(self, ridge: Row) -> bool:
        """Solve by L D L^T; False where rounding or an overflow left nothing to solve."""
        size = len(ridge)
        scaled: list[Row] = []  # rows of L
        left: list[Row] = []
        pivots: Row = []
        for index in range(len(self.rows)):
            row = [*self.rows[index]]  # becomes a row of L D
            own: Row = []
            for column in range(min(index, size)):
                rest, other = row[column], scaled[column]
                for before in range(column):
                    rest -= row[before] * other[before]
                row[column] = rest
                own.append(rest / pivots[column])
            scaled.append(own)
            for column in range(size if index >= size else index, index + 1):
                rest, other = row[column], scaled[column]
                for before in range(len(other)):
                    rest -= row[before] * other[before]
                row[column] = rest
            if index < size:
                pivot = row[index] + ridge[index]
                if not pivot > 0.0:
                    return False
                pivots.append(pivot)
            else:
                left.append(row[size:])
        self.unexplained = left
        self.solutions = [_substituted(scaled, size, each) for each in scaled[size:]]
        return all(isfinite(sum(found)) for found in self.solutions)


def _substituted(lower: list[Row], size: int, right: Row) -> Row:
    """The solution of L^T w = right, for a unit lower triangle."""
    found = [*right]
    for index in range(size - 1, 0, -1):
        row, known = lower[index], found[index]
        for column in range(index):
            found[column] -= row[column] * known
    return found


class State:
    """The estimates of one state of the signal; `weights` are by estimate and horizon."""

    __slots__ = ("_horizon", "_kinds", "_motion", "_ridge", "_scale", "_size", "equations", "stiffness", "weights")

    def __init__(self, size: int, motion: int, kinds: int) -> None:
        self._size, self._motion, self._kinds = size, motion, kinds
        """Number of regressors, index of the first one of motion, after which only the value has no motion."""
        self.reset()

    def reset(self) -> None:
        self.equations = [Equations(self._size, self._kinds) for _ in HORIZONS]
        estimates = 2 if self._kinds > 1 else 1
        self.weights: list[list[Row]] = [[[0.0] * self._size for _ in HORIZONS] for _ in range(estimates)]
        self.stiffness: tuple[float, float] = _STILL
        self._ridge: Row = []
        self._scale = 0.0
        self._horizon = 0

    def solve(self) -> None:
        """Solve for the weights of the next horizon, and after the last one for the stiffness."""
        horizon = self._horizon
        if horizon == 0:
            own = moved = 0.0
            if self._kinds > 1:
                for equations in self.equations:
                    own, moved = own + equations.rows[-3][-1], moved + equations.rows[-2][-1]
            self._scale = scale = moved / own if own > 0.0 else 0.0
            self._ridge = [RIDGE] * self._size
            for index in range(self._motion, self._size - 1):
                self._ridge[index] = RIDGE * (scale if scale > 0.0 else 1.0)
        equations = self.equations[horizon]
        if not equations.solve(self._ridge):
            self.reset()
            return
        self.weights[0][horizon] = equations.solutions[0]
        if self._kinds > 1:
            self.weights[1][horizon] = self._beside_stiffness(equations)
        self._horizon = (horizon + 1) % len(HORIZONS)
        if self._kinds > 1 and self._horizon == 0:
            self._stiffen()

    def _stiffen(self) -> None:
        """K of what the regressors leave unexplained at all horizons, and the weights beside it."""
        aa = bb = RIDGE * self._scale
        ab = ac = bc = 0.0
        for equations in self.equations:
            _, (c, a), (d, b, e) = equations.unexplained
            aa, ab, bb, ac, bc = aa + a, ab + b, bb + e, ac + c, bc + d
        along = normal = 0.0
        if aa > 0.0 and self._scale > 0.0:
            rest = bb - ab / aa * ab
            if rest > 0.0:
                normal = (bc - ab / aa * ac) / rest
                along = (ac - ab * normal) / aa
        self.stiffness = (along, normal)
        self.weights[1] = [self._beside_stiffness(equations) for equations in self.equations]
        if not all(isfinite(sum(each)) for each in self.weights[1]):
            self.reset()

    def _beside_stiffness(self, equations: Equations) -> Row:
        path, first, second = equations.solutions
        along, normal = self.stiffness
        return [w - (along * a + normal * b) for w, a, b in zip(path, first, second)]  # noqa: B905 - as above


class Noted:
    """A sample that is compared with what follows it.

    `xs`, `ys` and `zs` are its regressors by axis, `squares` their products with each other, `expected` what each
    estimate expects at each horizon, with this stiffness.
    """

    __slots__ = ("direction", "expected", "place", "squares", "state", "stiffness", "value", "weight", "xs", "ys", "zs")

    def __init__(self, value: Vector, place: Vector, regressors: list[Vector], number: int, state: State) -> None:
        self.value, self.place, self.state = value, place, number
        size = sqrt(dot(value, value))
        self.direction = (value[0] / size, value[1] / size, value[2] / size) if size > 0.0 else ZERO
        self.weight = 0.0
        self.xs = xs = [each[0] for each in regressors]
        self.ys = ys = [each[1] for each in regressors]
        self.zs = zs = [each[2] for each in regressors]
        self.squares: list[Row] = []
        self.stiffness = state.stiffness
        self.expected: list[list[Vector]] = []
        for by_horizon in state.weights:
            path = []
            for weights in by_horizon:
                x = y = z = 0.0
                for weight, a, b, c in zip(weights, xs, ys, zs):  # noqa: B905 - as above
                    x += weight * a
                    y += weight * b
                    z += weight * c
                path.append((x, y, z))
            self.expected.append(path)

    def keep(self, bound: float) -> None:
        """Make ready what a comparison reads; `bound` is the deadband."""
        square = bound * bound  # 0 for a tiny deadband too
        self.weight = 1.0 / square if square > SMALLEST else 0.0
        xs, ys, zs = self.xs, self.ys, self.zs
        for index in range(len(xs)):
            x, y, z = xs[index], ys[index], zs[index]
            self.squares.append([x * xs[other] + y * ys[other] + z * zs[other] for other in range(index + 1)])


class PathLearner:
    """The estimates of one signal.

    The work of a step is spread over its ticks. Sums and weights are changed in the tick that needs them, so a gap
    between two ticks leaves them whole.
    """

    def __init__(self, signal: Signal) -> None:
        period = signal.grid.period
        self._lags = sorted({_ticks(lag, period) for lag in LAGS_S})
        self._has_positions = has_positions = signal.grid.position is not None
        self._motion = [_ticks(lag, period) for lag in MOTION_S] if has_positions else []
        self._turn = _ticks(STATE_S, period)
        self._step = _ticks(STEP_S, period)
        self._threshold = signal.least_contact * signal.least_contact
        self._forget = exp(-self._step * period / MEMORY_S)
        self._kept = max(*self._lags, *self._motion, self._turn) + 1
        motion, kinds = 2 * len(self._lags) - 1, 3 if has_positions else 1
        self._states = [State(motion + len(self._motion) + 1, motion, kinds) for _ in range(STATES)]
        self._begin()

    def _begin(self) -> None:
        self._totals: list[Vector] = []
        self._total = ZERO
        self._noted: list[Noted] = []
        self._ticks = self._steps = 0

    def follow(self, history: History) -> None:
        """Take in the newest sample. A gap in the samples ends the past, not the estimates."""
        if not history.follows:
            self._begin()
        self._values, self._places, self._bound = history.values, history.places, history.bound
        self._newest: Noted | None = None
        if len(self._totals) == 4 * self._kept:
            # The sums begin anew, so that they keep their digits.
            start = self._totals[-1]
            self._totals = [subtract(each, start) for each in self._totals[-self._kept :]]
            self._total = subtract(self._total, start)
        self._totals.append(self._total)
        self._total = add(self._total, self._values[-1])
        phase, count = self._ticks % self._step, len(_WORK)
        self._ticks += 1
        for place in range(count * phase // self._step, count * (phase + 1) // self._step):
            work = _WORK[place]
            if work == _NOTE:
                slot, noted = self._steps % _SLOTS, self._expect()
                noted.keep(self._bound)
                self._noted[slot : slot + 1] = [noted]  # appended until there are so many
                self._steps += 1
            elif work == _SOLVE:
                self._states[self._noted[self._steps % _SLOTS - 1].state].solve()
                self._newest = None
            elif HORIZONS[work] < self._steps:
                self._compare(work)

    def learned(self) -> tuple[Learned, ...]:
        """What is expected after the newest sample: with K = 0 and, if the signal has positions, with K."""
        noted = self._expect()
        stiffness = (_STILL, noted.stiffness)
        return tuple([Learned(path, stiffness[index]) for index, path in enumerate(noted.expected)])

    def _expect(self) -> Noted:
        """The newest sample, and what each estimate expects after it."""
        if self._newest is None:
            regressors, state = self._look()
            self._newest = Noted(self._values[-1], self._places[-1], regressors, state, self._states[state])
        return self._newest

    def _look(self) -> tuple[list[Vector], int]:
        """The regressors of the newest sample, and its state."""
        values, totals, oldest = self._values, self._totals, len(self._totals) - 1
        x, y, z = values[-1]
        found: list[Vector] = []
        for lag in self._lags:
            a, b, c = values[-1 - min(lag, oldest)]
            found.append((x - a, y - b, z - c))
        u, v, w = totals[-1]
        for lag in self._lags[1:]:
            back = min(lag, oldest)
            a, b, c = totals[-1 - back]
            count = back + 1.0
            found.append((x - (u + x - a) / count, y - (v + y - b) / count, z - (w + z - c) / count))
        state = 0
        if self._has_positions:
            places = self._places
            u, v, w = places[-1]
            for lag in self._motion:
                a, b, c = places[-1 - min(lag, oldest)]
                found.append((u - a, v - b, w - c))
            if not x * x + y * y + z * z < self._threshold:
                a, b, c = places[-1 - min(self._turn, oldest)]
                state = 1 if (u - a) * x + (v - b) * y + (w - c) * z > 0.0 else 2
        found.append((VALUE * x, VALUE * y, VALUE * z))
        return found, state

    def _compare(self, index: int) -> None:
        """Compare the stored sample with what was expected of it at a horizon."""
        newest = self._steps - 1
        now, before = self._noted[newest % _SLOTS], self._noted[(newest - HORIZONS[index]) % _SLOTS]
        change = x, y, z = subtract(now.value, before.value)
        a, b, c = before.expected[0][index]
        missed = _square(x - a, y - b, z - c)
        changes = [change]
        if self._has_positions:
            moved = u, v, w = subtract(now.place, before.place)
            a, b, c = before.direction
            pressed = a * u + b * v + c * w
            a, b, c = a * pressed, b * pressed, c * pressed
            changes = [change, moved, (a, b, c)]
            along, normal = before.stiffness
            x, y, z = x - along * u - normal * a, y - along * v - normal * b, z - along * w - normal * c
            a, b, c = before.expected[1][index]
            other = _square(x - a, y - b, z - c)
            if other < missed or isnan(other):
                missed = other
        weight = before.weight
        weight /= 1.0 + missed * weight / (ROBUST * ROBUST)
        self._states[before.state].equations[index].add(before, changes, weight, self._forget)


def _square(x: float, y: float, z: float) -> float:
    return x * x + y * y + z * z


def _ticks(seconds: float, period: float) -> int:
    return max(1, round(seconds / period))
