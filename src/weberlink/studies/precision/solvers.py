"""Two independent reference solvers for a stretch of smooth motion: DOP853 of scipy, and Radau IIA collocation.

`dop853` is the explicit method of order 8 by Dormand and Prince (Hairer, Norsett, Wanner, "Solving Ordinary
Differential Equations I"). `collocation` is the implicit, L-stable Radau IIA method of order 17 (Hairer, Wanner,
"Solving Ordinary Differential Equations II", IV.5): the derivative over a step is one Legendre series through nine
nodes. A step is accepted when the tail of the series has vanished; the series is then as exact inside the step as at
its end, and guards are evaluated on it. The solvers share no code. scipy's own Radau method has order 5 and would need
far too many steps for this accuracy.
"""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from weberlink.studies.precision.equations import MotionState

RELATIVE = 3e-14  # the smallest tolerance that scipy accepts is 100 roundings
ABSOLUTE = (1e-17, 1e-17, 1e-17, 1e-15, 1e-15, 1e-15)  # [m], [m/s]

STAGES = 9
TAIL = 1e-13
"""Largest last Legendre coefficients of a step, relative to the size of the state."""
SIZE_LEAST = (1e-5, 1e-5, 1e-5, 1e-2, 1e-2, 1e-2)
"""Smallest size of the state [m], [m/s], so that a motion that dies out is not followed into its rounding."""
ITERATIONS = 12
LOOKS = 24
"""Points per step at which the guards are evaluated."""
NUDGE = (1e-5, 1e-5, 1e-5, 1e-3, 1e-3, 1e-3)  # [m], [m/s] for the Jacobian; exact where the field is linear
GROWTH = 3.0
LEAST_STEP = 1e-16  # [s]

Array = NDArray[np.floating[Any]]


class Stretch(NamedTuple):
    """An initial value problem between two events.

    Args:
        field: d(state)/dt.
        guards: functions of the state; the stretch ends where the first of them falls below zero.
        state: at `begin`.
        begin: [s].
        end: [s], more than `begin`.
        ticks: times in (begin, end] at which the state is wanted, ascending [s].
    """

    field: Callable[[MotionState], list[float]]
    guards: Sequence[Callable[[MotionState], float]]
    state: MotionState
    begin: float
    end: float
    ticks: Sequence[float]


class Outcome(NamedTuple):
    """States at the ticks reached; time [s], state and guard of the end (None: no guard fell)."""

    samples: list[list[float]]
    at: float
    state: list[float]
    fallen: int | None


class Solver(Protocol):
    def __call__(self, stretch: Stretch) -> Outcome:
        """Solve one stretch.

        Raises:
            ArithmeticError: if the accuracy cannot be reached.
        """
        ...


def dop853(stretch: Stretch) -> Outcome:
    """Solve with the explicit method of order 8; see `Solver`."""
    from scipy.integrate import solve_ivp  # noqa: PLC0415 - an extra, imported where it is needed

    answer = solve_ivp(
        lambda _, state: stretch.field(state.tolist()),
        (stretch.begin, stretch.end),
        np.array(stretch.state),
        method="DOP853",
        t_eval=[*stretch.ticks, *([] if stretch.end in stretch.ticks else [stretch.end])],
        events=[falling(guard) for guard in stretch.guards],
        rtol=RELATIVE,
        atol=ABSOLUTE,
    )
    if answer.status < 0:
        raise ArithmeticError(f"DOP853: {answer.message}")
    samples = np.transpose(answer.y).tolist()  # scipy returns an empty list before the first tick
    for index, (times, states) in enumerate(zip(answer.t_events or (), answer.y_events or (), strict=True)):
        if len(times):
            return Outcome(samples, float(times[0]), states[0].tolist(), index)
    return Outcome(samples[: len(stretch.ticks)], stretch.end, samples[-1], None)


def falling(guard: Callable[[MotionState], float]) -> Callable[[float, Array], float]:
    """The guard as a terminal event of scipy."""

    def event(_: float, state: Array) -> float:
        return guard(state.tolist())

    event.terminal = True  # type: ignore[attr-defined]
    event.direction = -1.0  # type: ignore[attr-defined]
    return event


class Tableau(NamedTuple):
    """Matrices of the method for the step from 0 to 1.

    Args:
        weights: integrate values at the nodes up to each node.
        series: Legendre coefficients of values at the nodes.
        looks: integrate coefficients up to each point at which guards are read.
    """

    weights: Array
    series: Array
    looks: Array


class CollocationStep(NamedTuple):
    """An accepted step: state at its start, its length [s], and the Legendre coefficients of the derivative."""

    state: Array
    length: float
    coefficients: Array

    def at(self, share: float) -> Array:
        """The state at `share` of the step."""
        return self.state + self.length * (integrals(share) @ self.coefficients)


def collocation(stretch: Stretch) -> Outcome:
    """Solve with Radau IIA collocation of order 17; see `Solver`."""
    now, state = stretch.begin, np.array(stretch.state, dtype=float)
    scale = np.maximum(np.abs(state), SIZE_LEAST)
    samples: list[list[float]] = []
    length = stretch.end - stretch.begin
    while now < stretch.end:
        left = stretch.end - now
        length = min(length, left)
        step, tail = collocated(stretch, state, length, scale)
        if tail > 1.0:
            length *= max(0.2, 0.9 * tail ** (-1.0 / (STAGES - 1)))
            if length < LEAST_STEP:
                raise ArithmeticError(f"collocation: no step is short enough at {now:g} s")
            continue
        fallen = first_fall(stretch, step)
        reached = 1.0 if fallen is None else fallen[0]
        end = now + reached * length if reached < 1.0 or length < left else stretch.end
        for tick in stretch.ticks[len(samples) :]:
            if tick > end:
                break
            samples.append(step.at((tick - now) / length).tolist())
        now, state = end, step.at(reached)
        if fallen is not None:
            return Outcome(samples, now, state.tolist(), fallen[1])
        scale = np.maximum(scale, np.abs(state))
        length *= min(GROWTH, 0.9 * max(tail, 1e-9) ** (-1.0 / (STAGES - 1)))
    return Outcome(samples, now, state.tolist(), None)


def collocated(stretch: Stretch, state: Array, length: float, scale: Array) -> tuple[CollocationStep, float]:
    """One step by simplified Newton iteration, and its tail relative to the tolerance; infinite if it failed."""
    weights, series, _ = tableau()
    field = stretch.field
    slopes = np.tile(np.array(field(state.tolist())), (STAGES, 1))
    system = np.eye(STAGES * 6) - length * np.kron(weights, jacobian(stretch, state))
    inverse = np.linalg.inv(system)
    smallest = np.inf
    for _ in range(ITERATIONS):
        stages = state + length * (weights @ slopes)
        residual = np.array([field(stage) for stage in stages.tolist()]) - slopes
        correction = (inverse @ residual.ravel()).reshape(slopes.shape)
        slopes = slopes + correction
        size = float(np.max(np.abs(correction)))
        if not size < smallest:
            break  # rounding is reached, or it does not converge; checked below
        smallest = size
    largest = np.max(np.abs(slopes), axis=0)
    if not np.all(np.abs(correction) <= 1e-9 * (largest + 1e-12)):
        return CollocationStep(state, length, slopes), np.inf
    coefficients = series @ slopes
    allowed = TAIL * np.maximum(scale, length * largest)
    tail = length * np.max(np.abs(coefficients[-2:]), axis=0)
    return CollocationStep(state, length, coefficients), float(np.max(tail / allowed))


def jacobian(stretch: Stretch, state: Array) -> Array:
    """d(field)/d(state) by central differences."""
    columns = []
    for axis, nudge in enumerate(NUDGE):
        ahead, behind = state.tolist(), state.tolist()
        ahead[axis] += nudge
        behind[axis] -= nudge
        columns.append((np.array(stretch.field(ahead)) - np.array(stretch.field(behind))) / (2.0 * nudge))
    return np.stack(columns, axis=1)


def first_fall(stretch: Stretch, step: CollocationStep) -> tuple[float, int] | None:
    """Where in the step (as a share of it) the first guard falls below zero, and which; None if all of them hold."""
    if not stretch.guards:
        return None
    states = (step.state + step.length * (tableau().looks @ step.coefficients)).tolist()
    before = [guard(states[0]) for guard in stretch.guards]
    for look in range(1, LOOKS + 1):
        after = [guard(states[look]) for guard in stretch.guards]
        falls = [
            (bisected(stretch, step, index, (look - 1) / LOOKS, look / LOOKS), index)
            for index, (value, next_value) in enumerate(zip(before, after, strict=True))
            if value >= 0.0 > next_value
        ]
        if falls:
            return min(falls)
        before = after
    return None


def bisected(stretch: Stretch, step: CollocationStep, index: int, low: float, high: float) -> float:
    """The share between `low` (guard holds) and `high` (guard has fallen) where it falls, to the last digit."""
    guard = stretch.guards[index]
    while True:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            return high
        if guard(step.at(middle).tolist()) >= 0.0:
            low = middle
        else:
            high = middle


@cache
def tableau() -> Tableau:
    """Nodes are the zeros of P_s - P_(s-1) on [-1, 1], the last of them 1."""
    difference = np.zeros(STAGES + 1)
    difference[-1], difference[-2] = 1.0, -1.0
    nodes = np.sort(legendre.legroots(difference).real)
    slope = legendre.legder(difference)
    for _ in range(3):
        nodes = nodes - legendre.legval(nodes, difference) / legendre.legval(nodes, slope)
    nodes[-1] = 1.0
    series = np.linalg.inv(legendre.legvander(nodes, STAGES - 1))
    weights = np.array([integrals((node + 1.0) / 2.0) for node in nodes]) @ series
    return Tableau(weights, series, np.array([integrals(look / LOOKS) for look in range(LOOKS + 1)]))


def integrals(share: float) -> Array:
    """Integral from 0 to `share` of each P_k(2 u - 1): (P_(k+1) - P_(k-1)) / (2 (2 k + 1))."""
    values = legendre.legvander(np.array([2.0 * share - 1.0]), STAGES)[0]
    k = np.arange(1, STAGES)
    rest: Array = (values[2:] - values[: STAGES - 1]) / (2.0 * (2.0 * k + 1.0))
    return np.concatenate(([share], rest))
