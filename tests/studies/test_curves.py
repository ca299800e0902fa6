"""Means over units with confidence intervals, and their table."""

import csv
from math import nan
from pathlib import Path
from random import Random
from statistics import fmean

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.studies.curves import Observation, curves, write_csv

WEBERS = (0.30, 0.025, 0.10)


def study(units: int = 8, predictors: tuple[str, ...] = ("hybrid", "zoh"), seed: int = 1) -> list[Observation]:
    random = Random(seed)
    return [
        Observation(f"s{unit}", predictor, weber, random.uniform(5.0, 150.0), random.uniform(0.0, 5.0))
        for unit in range(units)
        for predictor in predictors
        for weber in WEBERS
    ]


def test_means_are_those_of_the_units_in_order_of_predictor_and_weber() -> None:
    observations = study()
    found = curves(observations)
    assert list(found) == ["hybrid", "zoh"]
    for predictor, points in found.items():
        assert [point.weber for point in points] == sorted(WEBERS)
        for point in points:
            mine = [one for one in observations if (one.predictor, one.weber) == (predictor, point.weber)]
            assert (point.predictor, point.units) == (predictor, 8)
            assert point.packets_per_s.mean == pytest.approx(fmean(one.packets_per_s for one in mine))
            assert point.quality.mean == pytest.approx(fmean(one.quality for one in mine))
            assert point.quality.low < point.quality.mean < point.quality.high
            assert min(one.quality for one in mine) <= point.quality.low
            assert max(one.quality for one in mine) >= point.quality.high


def test_bands_depend_on_the_seed_and_not_on_order() -> None:
    observations = study()
    first = curves(observations, seed=3)
    assert curves(observations, seed=3) == first
    shuffled = Random(9).sample(observations, len(observations))
    again = curves(shuffled, seed=3)
    for predictor, points in first.items():
        for point, other in zip(points, again[predictor], strict=True):
            assert other.quality == pytest.approx(point.quality, rel=1e-12)
            assert other.packets_per_s == pytest.approx(point.packets_per_s, rel=1e-12)
    assert curves(observations, seed=4) != first


def test_all_predictors_are_resampled_alike() -> None:
    """A predictor that is one unit better for everybody has the very band of the other, one unit higher."""
    plain = [one for one in study() if one.predictor == "zoh"]
    better = [Observation(one.unit, "plane", one.weber, one.packets_per_s, one.quality + 1.0) for one in plain]
    found = curves(plain + better)
    for low, high in zip(found["zoh"], found["plane"], strict=True):
        assert [end + 1.0 for end in low.quality] == pytest.approx(list(high.quality), rel=1e-12)
        assert low.packets_per_s == high.packets_per_s


def test_repeats_of_a_unit_are_averaged_before_units_are() -> None:
    observations = [Observation("a", "zoh", 0.1, rate, 2.0 * rate) for rate in (10.0, 20.0, 60.0)]
    observations.append(Observation("b", "zoh", 0.1, 50.0, 100.0))
    (point,) = curves(observations)["zoh"]
    assert point.units == 2
    assert point.packets_per_s.mean == pytest.approx(40.0)
    assert point.quality.mean == pytest.approx(80.0)


def test_one_unit_has_no_interval() -> None:
    assert curves([]) == {}
    (point,) = curves([Observation("a", "zoh", 0.1, 12.0, 3.0)])["zoh"]
    assert point.packets_per_s == (12.0, 12.0, 12.0)
    assert point.quality == (3.0, 3.0, 3.0)


def test_a_missing_combination_is_named() -> None:
    observations = study()
    lacking = [one for one in observations if (one.unit, one.predictor, one.weber) != ("s3", "zoh", 0.10)]
    with pytest.raises(ValueError, match=r"s3, zoh at k = 0\.1: not observed; expected every unit"):
        curves(lacking)
    with pytest.raises(ValueError, match=r"\(and 1 more\)"):
        curves([one for one in lacking if (one.unit, one.predictor, one.weber) != ("s4", "zoh", 0.10)])


@pytest.mark.parametrize("spoilt", [(nan, 1.0, 1.0), (0.1, nan, 1.0), (0.1, 1.0, float("inf"))])
def test_what_is_not_finite_is_refused_by_name(spoilt: tuple[float, float, float]) -> None:
    weber, rate, quality = spoilt
    with pytest.raises(ValueError, match=r"tue_foam_1, zoh .*expected finite numbers"):
        curves([Observation("tue_foam_1", "zoh", weber, rate, quality)])


@examples(25)
@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=6))
def test_a_band_holds_its_mean(qualities: list[float]) -> None:
    observations = [Observation(str(unit), "zoh", 0.1, 7.1, quality) for unit, quality in enumerate(qualities)]
    (point,) = curves(observations)["zoh"]
    assert point.quality.low <= point.quality.mean <= point.quality.high
    assert point.packets_per_s.low == pytest.approx(7.1)
    assert point.packets_per_s.low <= point.packets_per_s.mean <= point.packets_per_s.high


def test_the_interval_covers_the_true_mean_as_theory_says() -> None:
    """Normal units: about 1.96 sigma / sqrt(n) each way; percentile intervals cover slightly less than 95 %."""
    random = np.random.default_rng(5)
    units, studies = 40, 60
    lengths, covered = [], 0
    for number in range(studies):
        values = random.normal(3.0, 1.0, units)
        observations = [Observation(str(unit), "zoh", 0.1, 1.0, value) for unit, value in enumerate(values.tolist())]
        band = curves(observations, seed=number)["zoh"][0].quality
        lengths.append(band.high - band.low)
        covered += band.low <= 3.0 <= band.high
    assert fmean(lengths) == pytest.approx(2.0 * 1.96 / units**0.5, rel=0.08)
    assert 0.86 <= covered / studies <= 0.99


def test_the_table_reads_back(tmp_path: Path) -> None:
    found = curves(study())
    write_csv(found, tmp_path / "curves.csv", "error_rms_jnd")
    with (tmp_path / "curves.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == [
        "predictor", "weber", "units", "packets_per_s_mean", "packets_per_s_low", "packets_per_s_high",
        "error_rms_jnd_mean", "error_rms_jnd_low", "error_rms_jnd_high",
    ]  # fmt: skip
    points = [point for mine in found.values() for point in mine]
    for row, point in zip(rows, points, strict=True):
        assert (row["predictor"], float(row["weber"]), int(row["units"])) == (point.predictor, point.weber, point.units)
        assert [float(row[f"packets_per_s_{end}"]) for end in ("mean", "low", "high")] == list(point.packets_per_s)
        assert [float(row[f"error_rms_jnd_{end}"]) for end in ("mean", "low", "high")] == list(point.quality)
    write_csv(found, tmp_path / "marked.csv", "rating", "SIMULATED RATINGS")
    with (tmp_path / "marked.csv").open(newline="", encoding="utf-8") as file:
        assert [row["mark"] for row in csv.DictReader(file)] == ["SIMULATED RATINGS"] * 6
