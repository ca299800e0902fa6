"""Running statistics of an error against its bound, and how figures of nothing are said."""

from dataclasses import dataclass, field
from math import isnan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weberlink.system.scoring.distribution import Distribution
from weberlink.system.scoring.energy import Series


@dataclass
class Errors:
    """Running statistics of an error against its bound."""

    count: int = 0
    violations: int = 0
    square_sum: float = 0.0
    largest: float = 0.0
    longest_run: int = 0
    jnd: Distribution = field(default_factory=Distribution)  # in millionths, for its bins end at 1
    _run: int = 0

    def add(self, errors: Series, bounds: Series, deviations: Series | None = None) -> None:
        """Take the next ticks.

        Args:
            errors: in the unit of the values, shape (n,).
            bounds: of the deviations, shape (n,).
            deviations: the same errors as the deadband measures them; None where it measures distance.
        """
        deviations = errors if deviations is None else deviations
        outside = deviations > bounds
        self.count += len(errors)
        self.violations += int(outside.sum())
        self.square_sum += float((errors * errors).sum())
        if len(errors):
            self.largest = max(self.largest, float(errors.max()))
        noticed = bounds > 0.0  # a bound of 0 is no unit
        self.jnd.add(deviations[noticed] / bounds[noticed] * 1e6)
        for value in outside.tolist():
            self._run = self._run + 1 if value else 0
            self.longest_run = max(self.longest_run, self._run)

    def summary(self, period: float) -> dict[str, float | None]:
        jnd = known({"max": self.jnd.max * 1e-6, "p99": self.jnd.percentile(99.0) * 1e-6})
        return {
            "error_rms": (self.square_sum / self.count) ** 0.5 if self.count else None,
            "error_max": self.largest if self.count else None,
            "violation_fraction": self.violations / self.count if self.count else None,
            "violation_longest_ticks": self.longest_run,
            "violation_longest_s": self.longest_run * period if self.count else None,
            "violation_s": self.violations * period if self.count else None,
            "violation_max_jnd": jnd["max"],
            "violation_p99_jnd": jnd["p99"],
        }


def tally(counts: dict[int, int], values: NDArray[Any]) -> None:
    """Count values into a table of those that there are."""
    for value, count in zip(*(column.tolist() for column in np.unique(values, return_counts=True)), strict=True):
        counts[value] = counts.get(value, 0) + count


def known(figures: dict[str, float]) -> dict[str, float | None]:
    """None for what nothing was counted of: JSON has no NaN."""
    return {name: None if isnan(value) else value for name, value in figures.items()}
