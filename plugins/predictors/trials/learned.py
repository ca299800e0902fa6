"""A day of the learned path: its least squares lose no digits, however long a session lasts.

    python -m plugins.predictors.trials.learned --hours 24

The sums of one horizon take a sample in every step of 4 ms, as in a daemon. At every full hour what they expect is
compared with what sums expect that began sixty time constants before: of what is older, forgetting leaves a part in
1e26, so that a difference is what rounding has gathered. Minutes with the compiled build.
"""

import argparse
import sys
from math import exp, inf, pi, sin
from random import Random

from weberlink.geometry.vector import ZERO, Vector, norm
from weberlink_predictors.learning import MEMORY_S, RIDGE, Equations, Noted, State
from weberlink_predictors.path import STEP_S

SIZE = 8
FRESH = 60
"""Time constants that the younger sums have seen."""
MOST = 1e-9
"""Largest difference, as a share of the changes that are expected."""


def sample(random: Random, step: int) -> tuple[Noted, Vector, float]:
    """Regressors that are nearly alike, as differences over lags are, what followed, and a weight."""
    base = [sin(2.0 * pi * hz * STEP_S * step) for hz in (0.31, 1.7, 6.1)]
    rows = [
        (base[0] * lag + random.gauss(0.0, 1e-3), base[1] * lag * lag + 1e-3 * lag, base[2] / (1.0 + lag))
        for lag in range(SIZE)
    ]
    noted = Noted(ZERO, ZERO, rows, 0, State(SIZE, SIZE - 1, 1))
    noted.keep(2e-4)
    return noted, (rows[1][0] + 0.2 * base[2], rows[2][1] - base[0], 0.5 * base[2]), 1e5 * random.random()


def worst_difference(rounds: int, steps: int, memory: float) -> float:
    """The largest difference at the ends of all rounds of some steps; inf where there was nothing to solve.

    Args:
        rounds, steps: of each round more than `FRESH` time constants.
        memory: time constant of forgetting [steps].
    """
    random, forget, ridge = Random(1), exp(-1.0 / memory), [RIDGE] * SIZE
    lasting, worst = Equations(SIZE, 1), 0.0
    for each in range(rounds):
        fresh = Equations(SIZE, 1)
        for step in range(steps):
            noted, change, weight = sample(random, each * steps + step)
            lasting.add(noted, [change], weight, forget)
            if step >= steps - FRESH * memory:
                fresh.add(noted, [change], weight, forget)
        if not (lasting.solve(ridge) and fresh.solve(ridge)):
            return inf
        apart = [one - other for one, other in zip(lasting.solutions[0], fresh.solutions[0], strict=True)]
        for axis in (noted.xs, noted.ys, noted.zs):
            worst = max(worst, abs(sum(a * b for a, b in zip(apart, axis, strict=True))) / norm(change))
    return worst


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=int, default=24)
    hours: int = parser.parse_args().hours
    steps = round(3600.0 / STEP_S)
    worst = worst_difference(hours, steps, MEMORY_S / STEP_S)
    print(f"{hours} h, {hours * steps} updates: what is expected differs by {worst:.1e} at most; limit {MOST:g}")
    return 0 if worst <= MOST else 1


if __name__ == "__main__":
    sys.exit(main())
