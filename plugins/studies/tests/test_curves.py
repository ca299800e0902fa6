"""Means over units with confidence intervals, and their table."""

import pytest
from pandas import DataFrame

from weberlink_studies.curves import curves

COLUMNS = ["unit", "predictor", "weber", "packets_per_s", "quality"]


def test_means_are_over_units_with_a_band_between_the_worst_and_the_best() -> None:
    """The rate of unit n is 10 n over the Weber factor, that of another predictor twice it; its quality is n."""
    rows = [
        (f"s{unit}", predictor, weber, factor * 10.0 * unit / weber, float(unit))
        for unit in range(1, 6)
        for predictor, factor in (("zoh", 1.0), ("hybrid", 2.0))
        for weber in (0.5, 0.025, 0.1)
    ]
    found = curves(DataFrame(rows, columns=COLUMNS), "quality")
    assert [(*point[1:4], point.packets_per_s_mean) for point in found.itertuples()] == [
        (predictor, weber, 5, pytest.approx(factor * 30.0 / weber))
        for predictor, factor in (("zoh", 1.0), ("hybrid", 2.0))
        for weber in (0.025, 0.1, 0.5)
    ]
    assert found.quality_mean.to_list() == pytest.approx([3.0] * 6)
    assert all(1.0 <= low < 3.0 < high <= 5.0 for low, high in zip(found.quality_low, found.quality_high, strict=True))


def test_repeats_of_a_unit_are_averaged_before_units_are() -> None:
    rows = [*(("a", "zoh", 0.1, rate, 2.0 * rate) for rate in (10.0, 20.0, 60.0)), ("b", "zoh", 0.1, 50.0, 100.0)]
    (point,) = curves(DataFrame(rows, columns=COLUMNS), "quality").itertuples()
    assert (point.units, point.packets_per_s_mean, point.quality_mean) == (2, pytest.approx(40.0), pytest.approx(80.0))
