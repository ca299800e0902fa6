"""The order of convergence that errors show: the slope of log error over log step, where it is straight."""

from collections.abc import Sequence
from math import log

COARSE = 0.03
"""Relative errors above it do not yet follow the order."""
POINTS_LEAST = 3
POINTS_MOST = 4


def fitted_order(steps: Sequence[float], errors: Sequence[float | None], floor: float) -> float | None:
    """Least squares over the finest four of the steps whose errors are asymptotic.

    Args:
        steps: lengths, in any order and unit.
        errors: relative; None where the run diverged.
        floor: errors below it are rounding, or the reference's own.

    Returns:
        The order; None where fewer than three errors lie between `floor` and 3 %.
    """
    usable = [
        (log(step), log(error))
        for step, error in sorted(zip(steps, errors, strict=True), key=lambda pair: pair[0])
        if error is not None and floor < error < COARSE
    ][:POINTS_MOST]
    if len(usable) < POINTS_LEAST:
        return None
    mean_x = sum(x for x, _ in usable) / len(usable)
    mean_y = sum(y for _, y in usable) / len(usable)
    covariance = sum((x - mean_x) * (y - mean_y) for x, y in usable)
    return covariance / sum((x - mean_x) ** 2 for x, _ in usable)
