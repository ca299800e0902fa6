"""Means over units with confidence intervals, and their table."""

from random import Random
from statistics import fmean

import pytest
from pandas import DataFrame

from weberlink_studies.curves import curves

WEBERS = (0.30, 0.025, 0.10)


COLUMNS = ["unit", "predictor", "weber", "packets_per_s", "quality"]


def observed(*rows: tuple[object, ...]) -> DataFrame:
    return DataFrame(rows, columns=COLUMNS)


def study(units: int = 8, predictors: tuple[str, ...] = ("zoh", "hybrid"), seed: int = 1) -> DataFrame:
    random = Random(seed)
    return observed(
        *(
            (f"s{unit}", predictor, weber, random.uniform(5.0, 150.0), random.uniform(0.0, 5.0))
            for unit in range(units)
            for predictor in predictors
            for weber in WEBERS
        )
    )


def test_means_are_over_units() -> None:
    rows = study()
    found = curves(rows, "quality")
    assert list(zip(found.predictor, found.weber, strict=True)) == [
        (predictor, weber) for predictor in ("zoh", "hybrid") for weber in sorted(WEBERS)
    ]
    assert set(found.units) == {8}
    for point in found.itertuples():
        mine = rows[(rows.predictor == point.predictor) & (rows.weber == point.weber)]
        assert point.packets_per_s_mean == pytest.approx(fmean(mine.packets_per_s))
        assert point.quality_mean == pytest.approx(fmean(mine.quality))
        assert mine.quality.min() <= point.quality_low < point.quality_mean < point.quality_high <= mine.quality.max()


def test_repeats_of_a_unit_are_averaged_before_units_are() -> None:
    rows = [("a", "zoh", 0.1, rate, 2.0 * rate) for rate in (10.0, 20.0, 60.0)]
    (point,) = curves(observed(*rows, ("b", "zoh", 0.1, 50.0, 100.0)), "quality").itertuples()
    assert (point.units, point.packets_per_s_mean, point.quality_mean) == (2, pytest.approx(40.0), pytest.approx(80.0))
