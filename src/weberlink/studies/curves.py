"""Packet rate and quality over the Weber factor: means over traces or subjects with confidence intervals.

The intervals are percentile intervals of a bootstrap over units (Efron and Tibshirani, An Introduction to the
Bootstrap, 1993). A unit is drawn with all of its observations, because those of one trace or person are dependent. With
few units the interval is somewhat too narrow.
"""

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

RESAMPLES = 10_000
CONFIDENCE = 0.95

Array = NDArray[np.float64]
Combination = tuple[str, float]
"""A predictor and a Weber factor."""


@dataclass(frozen=True)
class Observation:
    """The measurement of one unit, a trace or a subject, with one predictor and Weber factor."""

    unit: str
    predictor: str
    weber: float
    packets_per_s: float
    quality: float


class Band(NamedTuple):
    """A mean over units and its 95 % confidence interval, low <= mean <= high."""

    mean: float
    low: float
    high: float


@dataclass(frozen=True)
class CurvePoint:
    """One predictor at one Weber factor."""

    predictor: str
    weber: float
    units: int
    packets_per_s: Band
    quality: Band


Curves = dict[str, list[CurvePoint]]
"""Points by rising Weber factor, per predictor in order of first appearance."""


def curves(observations: Sequence[Observation], *, seed: int = 0) -> Curves:
    """Means over units with confidence intervals.

    Every one of the `RESAMPLES` resamples uses the same units for all predictors and Weber factors, so that bands of
    the same seed can be compared. The order of the observations does not matter. With one unit, low = high = mean.

    Args:
        observations: every unit with every combination of predictor and Weber factor that occurs. Several of one unit
            and combination are averaged first, so that a unit counts once.
        seed: of the bootstrap.

    Raises:
        ValueError: a number is not finite, or a unit lacks a combination.
    """
    cells = _cells(observations)
    units = sorted({unit for unit, _ in cells})
    combinations = list(dict.fromkeys(combination for _, combination in cells))
    _check_complete(cells, units, combinations)
    table = np.array([[cells[unit, combination] for combination in combinations] for unit in units])
    points: Curves = {}
    for combination, (rate, quality) in zip(combinations, _bands(table, seed), strict=True):
        predictor, weber = combination
        points.setdefault(predictor, []).append(CurvePoint(predictor, weber, len(units), rate, quality))
    return {predictor: sorted(mine, key=lambda point: point.weber) for predictor, mine in points.items()}


def write_csv(curves: Curves, path: Path, quality: str, mark: str | None = None) -> None:
    """One row per point: predictor, weber, units, then mean, low and high of the packet rate and of the quality.

    Args:
        quality: prefix of the last three columns, such as "rating" or "error_rms_jnd".
        mark: a warning for every row, such as "SIMULATED RATINGS", in a column `mark`; most CSV readers do not read
            comment lines.
    """
    header = ["predictor", "weber", "units"]
    header += [f"{name}_{end}" for name in ("packets_per_s", quality) for end in Band._fields]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header + (["mark"] if mark is not None else []))
        for point in (point for points in curves.values() for point in points):
            row = [point.predictor, point.weber, point.units, *point.packets_per_s, *point.quality]
            writer.writerow(row + ([mark] if mark is not None else []))


def _cells(observations: Iterable[Observation]) -> dict[tuple[str, Combination], tuple[float, float]]:
    """Mean packet rate and quality of each unit and combination."""
    gathered: dict[tuple[str, Combination], list[tuple[float, float]]] = {}
    for one in observations:
        if not (isfinite(one.weber) and isfinite(one.packets_per_s) and isfinite(one.quality)):
            raise ValueError(f"{_name(one.unit, (one.predictor, one.weber))}: expected finite numbers, found {one}")
        key = one.unit, (one.predictor, one.weber)
        gathered.setdefault(key, []).append((one.packets_per_s, one.quality))
    return {
        key: (sum(rate for rate, _ in both) / len(both), sum(quality for _, quality in both) / len(both))
        for key, both in gathered.items()
    }


def _check_complete(
    cells: dict[tuple[str, Combination], tuple[float, float]], units: list[str], combinations: list[Combination]
) -> None:
    lacking = [(unit, one) for unit in units for one in combinations if (unit, one) not in cells]
    if lacking:
        more = f" (and {len(lacking) - 1} more)" if len(lacking) > 1 else ""
        raise ValueError(
            f"{_name(*lacking[0])}: not observed{more}; expected every unit with every predictor and Weber factor"
        )


def _name(unit: str, combination: Combination) -> str:
    return f"{unit}, {combination[0]} at k = {combination[1]:g}"


def _bands(table: Array, seed: int) -> list[list[Band]]:
    """Per combination the bands of rate and quality; `table` has shape (units, combinations, 2)."""
    if not table.size:
        return []
    units = len(table)
    means = table.mean(axis=0)
    if units == 1:
        return [[Band(mean, mean, mean) for mean in pair] for pair in means.tolist()]
    drawn = np.random.default_rng(seed).integers(units, size=(RESAMPLES, units))
    weights = np.stack([np.bincount(draw, minlength=units) for draw in drawn]) / units
    resampled = np.einsum("ru,ucq->rcq", weights, table, optimize=True)
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(resampled, [tail, 100.0 - tail], axis=0)
    # Rounding may put the ends of a zero-width band on the wrong side of the mean.
    ends = np.stack([means, np.minimum(low, means), np.maximum(high, means)], axis=-1)
    return [[Band(*quantity) for quantity in pair] for pair in ends.tolist()]
