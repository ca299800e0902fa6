"""Rank tests and packets at equal quality, against results computed by hand."""

import numpy as np
import pytest
from pandas import DataFrame

from weberlink_studies.experiment.statistics import (
    ABOVE,
    BELOW,
    CROSSES,
    LEAST_SUBJECTS,
    against,
    crossing,
    friedman,
    savings,
)


def test_friedman_by_hand() -> None:
    """Six subjects rank three levels; sums of ranks 8, 11, 17: chi2 = 12/(6 3 4) (8^2 + 11^2 + 17^2) - 3 6 4 = 7."""
    table = np.array([[1, 2, 3], [1, 2, 3], [1, 2, 3], [1, 2, 3], [1, 2, 3], [3, 1, 2]], dtype=float)
    result = friedman(table)
    assert (result["chi_squared"], result["degrees"]) == (pytest.approx(7.0), 2)
    assert result["p"] == pytest.approx(np.exp(-7.0 / 2.0))  # chi-squared with 2 degrees of freedom
    assert result["kendalls_w"] == pytest.approx(7.0 / 12.0)
    assert result["remark"] == "approximate with 6 subjects"


def test_too_few_subjects_have_no_p() -> None:
    table = np.tile([1.0, 2.0, 3.0], (LEAST_SUBJECTS - 1, 1))
    result = friedman(table)
    assert (result["p"], result["chi_squared"]) == (None, None)
    assert result["remark"] == "too few subjects for a test: 5, needs 6"
    (pair,) = against(DataFrame({"zoh": table[:, 0], "other": table[:, 2]}), "zoh")
    assert pair == {"name": "other", "median_difference": 2.0, "w": None, "p": None, "p_holm": None}


def test_signed_rank_by_hand() -> None:
    """Differences 1 to 7, one of them negative: W = 3, and 10 of 128 signs are as extreme.

    Holm: the least of three p is multiplied by 3, the next by 2.
    """
    differences = {"mixed": [1.0, 2.0, -3.0, 4.0, 5.0, 6.0, 7.0], "risen": np.arange(1.0, 8.0), "same": np.zeros(7)}
    found = against(DataFrame({"zoh": np.zeros(7), **differences}), "zoh")
    assert [(one["name"], one["median_difference"], one["w"]) for one in found] == [
        *(("mixed", 4.0, 3.0), ("risen", 4.0, 0.0), ("same", 0.0, 0.0))
    ]
    assert [one["p"] for one in found] == pytest.approx([10 / 128, 2 / 128, 1.0])
    assert [one["p_holm"] for one in found] == pytest.approx([2 * 10 / 128, 3 * 2 / 128, 1.0])


RATES = (100.0, 60.0, 40.0, 20.0)


@pytest.mark.parametrize(
    ("ratings", "rate", "reach"),
    [
        ((5.0, 4.5, 3.5, 1.0), 50.0, CROSSES),
        ((5.0, 4.0, 3.0, 1.0), 60.0, CROSSES),
        ((5.0, 4.75, 3.75, 1.0), 45.0, CROSSES),
        ((3.9, 3.0, 2.0, 1.0), np.nan, BELOW),
        ((5.0, 5.0, 4.5, 4.0), 20.0, ABOVE),
        ((3.5, 5.5, 3.0, 1.0), 60.0 - 20.0 * 0.5 / 1.5, CROSSES),  # 4.5, 4.5, 3, 1
        ((2.0, 4.0, 6.0, 6.0), 20.0, ABOVE),  # 4.5 throughout
    ],
)
def test_where_a_curve_is_at_level_4(ratings: tuple[float, ...], rate: float, reach: str) -> None:
    found = crossing(RATES, ratings, 4.0)
    assert found == (pytest.approx(rate, nan_ok=True), reach)


ONE = ((5.0, 4.5, 3.5, 1.0), (5.0, 5.0, 5.0, 3.0), (3.0, 2.0, 1.0, 0.0), (5.0, 5.0, 5.0, 5.0))
OTHER = ((5.0, 4.5, 3.5, 1.0), (5.0, 4.5, 4.0, 3.0), (3.0, 2.0, 1.0, 0.0), (5.0, 5.0, 5.0, 5.0))


def test_savings_against_a_base_by_hand() -> None:
    found = savings(np.array([[RATES] * 4]), np.array([ONE]), 4.0, [0])
    assert [one["packets_per_s"] for one in found] == [50.0, 30.0, None, 20.0]
    assert [one["reach"] for one in found] == [CROSSES, CROSSES, BELOW, ABOVE]
    saved = [one["fewer_than"][0] for one in found]
    assert [one["share"] for one in saved] == [0.0, pytest.approx(0.4), None, pytest.approx(0.6)]
    assert [one["at_least"] for one in saved] == [False, False, False, True]
    assert all(one["low"] is None and one["high"] is None for one in saved)  # one subject says nothing of others


def test_the_interval_shows_disagreement() -> None:
    mixed = savings(np.array([[RATES] * 4] * 6), np.array([ONE] * 3 + [OTHER] * 3), 4.0, [0])[1]["fewer_than"][0]
    assert 0.2 <= mixed["low"] < mixed["share"] < mixed["high"] <= 0.4
