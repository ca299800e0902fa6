"""Reference solver two: Radau IIA collocation of order 17, implicit and L-stable, with its own step control and events.

Hairer, Wanner, "Solving Ordinary Differential Equations II", IV.5. The derivative over a step is one Legendre series
through nine nodes. The step is accepted when the tail of that series has vanished, so the series is as exact inside the
step as at its end, and guards are followed on it. Shares nothing with the other solver.
"""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from weberlink.studies.precision.smooth import Outcome, Stretch

STAGES = 9
TAIL = 1e-13
"""Largest share of the last Legendre coefficients in a step's change, against the size of the state."""
SIZE_LEAST = (1e-5, 1e-5, 1e-5, 1e-2, 1e-2, 1e-2)
"""[m], [m/s] what is smaller counts as this large; a motion that dies out is not followed into its rounding."""
ITERATIONS = 12
LOOKS = 24
"""Points per step at which the guards are read."""
NUDGE = (1e-5, 1e-5, 1e-5, 1e-3, 1e-3, 1e-3)  # [m], [m/s] for the Jacobian; exact where the field is linear
GROWTH = 3.0
LEAST_STEP = 1e-16  # [s]

Array = NDArray[np.floating[Any]]


class Tableau(NamedTuple):
    """Of the step from 0 to 1.

    Args:
        weights: integrate values at the nodes up to each node.
        series: Legendre coefficients of values at the nodes.
        looks: integrate coefficients up to each point at which guards are read.
    """

    weights: Array
    series: Array
    looks: Array


class Step(NamedTuple):
    """An accepted step: state at its start, its length [s], and the Legendre coefficients of the derivative."""

    state: Array
    length: float
    coefficients: Array

    def at(self, share: float) -> Array:
        """The state at `share` of the step."""
        return self.state + self.length * (integrals(share) @ self.coefficients)


def solve(stretch: Stretch) -> Outcome:
    """As `Solver`."""
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


def collocated(stretch: Stretch, state: Array, length: float, scale: Array) -> tuple[Step, float]:
    """One step by simplified Newton iteration, and its tail in units of what is allowed; infinite if it failed."""
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
            break  # what is left is rounding, or it does not converge; the check below tells
        smallest = size
    largest = np.max(np.abs(slopes), axis=0)
    if not np.all(np.abs(correction) <= 1e-9 * (largest + 1e-12)):
        return Step(state, length, slopes), np.inf
    coefficients = series @ slopes
    allowed = TAIL * np.maximum(scale, length * largest)
    tail = length * np.max(np.abs(coefficients[-2:]), axis=0)
    return Step(state, length, coefficients), float(np.max(tail / allowed))


def jacobian(stretch: Stretch, state: Array) -> Array:
    """d(field)/d(state) by central differences."""
    columns = []
    for axis, nudge in enumerate(NUDGE):
        ahead, behind = state.tolist(), state.tolist()
        ahead[axis] += nudge
        behind[axis] -= nudge
        columns.append((np.array(stretch.field(ahead)) - np.array(stretch.field(behind))) / (2.0 * nudge))
    return np.stack(columns, axis=1)


def first_fall(stretch: Stretch, step: Step) -> tuple[float, int] | None:
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


def bisected(stretch: Stretch, step: Step, index: int, low: float, high: float) -> float:
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
