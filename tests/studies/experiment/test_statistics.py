"""Rank tests and packets at equal quality, against results computed by hand."""

from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.studies.experiment.statistics import (
    LEAST_SUBJECTS,
    Crossing,
    Reach,
    against,
    crossing,
    falling,
    friedman,
    holm,
    savings,
)


def test_friedman_by_hand() -> None:
    """Six subjects rank three levels; sums of ranks 8, 11, 17: chi2 = 12/(6 3 4) (8^2 + 11^2 + 17^2) - 3 6 4 = 7."""
    table = np.array([[1, 2, 3], [1, 2, 3], [1, 2, 3], [1, 2, 3], [1, 2, 3], [3, 1, 2]], dtype=float)
    sums = table.sum(axis=0)
    assert sums.tolist() == [8.0, 11.0, 17.0]
    result = friedman(table)
    assert (
        result.chi_squared == pytest.approx(12 / (6 * 3 * 4) * (8**2 + 11**2 + 17**2) - 3 * 6 * 4) == pytest.approx(7.0)
    )
    assert result.degrees == 2
    assert result.p == pytest.approx(np.exp(-7.0 / 2.0))  # chi-squared with 2 degrees of freedom
    assert result.kendalls_w == pytest.approx(7.0 / 12.0)
    assert result.remark == "approximate with 6 subjects"


def test_too_few_subjects_have_no_p() -> None:
    table = np.tile([1.0, 2.0, 3.0], (LEAST_SUBJECTS - 1, 1))
    result = friedman(table)
    assert (result.p, result.chi_squared) == (None, None)
    assert result.remark == "too few subjects for a test: 5, needs 6"
    (pair,) = against(table[:, 0], {"other": table[:, 2]})
    assert (pair.p, pair.p_holm, pair.w, pair.median_difference) == (None, None, None, 2.0)


def test_signed_rank_by_hand() -> None:
    """Differences 1 to 7, one of them negative: W = 3, and 10 of 128 signs are as extreme, as counted below."""
    differences = np.array([1.0, 2.0, -3.0, 4.0, 5.0, 6.0, 7.0])
    extreme = sum(
        min(down, 28 - down) <= 3
        for signs in product((0, 1), repeat=7)
        for down in [sum(rank for rank, sign in zip(range(1, 8), signs, strict=True) if sign)]
    )
    assert extreme == 10
    (result,) = against(np.zeros(7), {"other": differences})
    assert (result.w, result.p) == (3.0, pytest.approx(10 / 128))
    assert result.median_difference == 4.0


def test_ties_and_zeros_are_counted_over_all_signs() -> None:
    """Seven equal differences and one of 0: all of one sign in 2 of 128 cases."""
    (result,) = against(np.zeros(8), {"other": np.array([0.5] * 7 + [0.0])})
    assert (result.w, result.p) == (0.0, pytest.approx(2 / 128))


def test_holm_by_hand() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.5, None, 0.9]) == [1.0, None, 1.0]
    assert holm([]) == []


@given(st.lists(st.floats(0.0, 1.0), max_size=8))
def test_holm_keeps_the_order_and_never_lowers(ps: list[float]) -> None:
    corrected = holm(ps)
    assert all(value is not None and p <= value <= 1.0 for p, value in zip(ps, corrected, strict=True))
    for (p, high), (q, low) in product(zip(ps, corrected, strict=True), repeat=2):
        if p < q:
            assert high is not None
            assert low is not None
            assert high <= low


RATES = (100.0, 60.0, 40.0, 20.0)
levels = st.lists(st.floats(0.0, 5.0), min_size=1, max_size=8)


@pytest.mark.parametrize(
    ("ratings", "expected"),
    [
        ((5.0, 4.5, 3.5, 1.0), Crossing(Reach.CROSSES, 50.0)),
        ((5.0, 4.0, 3.0, 1.0), Crossing(Reach.CROSSES, 60.0)),
        ((5.0, 4.75, 3.75, 1.0), Crossing(Reach.CROSSES, 45.0)),
        ((3.9, 3.0, 2.0, 1.0), Crossing(Reach.BELOW, None)),
        ((5.0, 5.0, 4.5, 4.0), Crossing(Reach.ABOVE, 20.0)),
        ((3.5, 5.5, 3.0, 1.0), Crossing(Reach.CROSSES, 60.0 - 20.0 * 0.5 / 1.5)),  # 4.5, 4.5, 3, 1
    ],
)
def test_where_a_curve_is_at_level_4(ratings: tuple[float, ...], expected: Crossing) -> None:
    found = crossing(RATES, ratings, 4.0)
    assert found.reach is expected.reach
    assert found.packets_per_s == (None if expected.packets_per_s is None else pytest.approx(expected.packets_per_s))


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ((5, 4, 3), [5, 4, 3]),
        ((3, 4, 5), [4, 4, 4]),
        ((5, 1, 3, 2), [5, 2, 2, 2]),
        ((2, 4, 1, 3, 0), [3, 3, 2, 2, 0]),
        ((), []),
    ],
)
def test_the_nearest_falling_sequence(values: tuple[float, ...], expected: list[float]) -> None:
    assert falling(values) == pytest.approx(expected)


@given(levels)
def test_falling_keeps_mean_and_falling_sequences(values: list[float]) -> None:
    smooth = falling(values)
    assert all(a >= b - 1e-12 for a, b in pairwise(smooth))
    assert np.mean(smooth) == pytest.approx(np.mean(values))
    ordered = sorted(values, reverse=True)
    assert falling(ordered) == ordered


def study(*subjects: tuple[tuple[float, ...], ...]) -> np.ndarray:
    return np.array(subjects)


def test_savings_against_a_base_by_hand() -> None:
    ratings = study(((5.0, 4.5, 3.5, 1.0), (5.0, 5.0, 5.0, 3.0), (3.0, 2.0, 1.0, 0.0), (5.0, 5.0, 5.0, 5.0)))
    rates = study((RATES, RATES, RATES, RATES))
    found, saved = savings(rates, ratings, 4.0, 0)
    assert [one.packets_per_s for one in found] == [50.0, 30.0, None, 20.0]
    assert [one.share for one in saved] == [0.0, pytest.approx(0.4), None, pytest.approx(0.6)]
    assert [one.at_least for one in saved] == [False, False, False, True]
    assert all(one.low is None and one.high is None for one in saved)  # one subject says nothing of others


def test_no_saving_against_a_base_without_crossing() -> None:
    for base in ((3.0, 2.0, 1.0, 0.0), (5.0, 5.0, 5.0, 5.0)):
        _, saved = savings(study((RATES, RATES)), study((base, (5.0, 4.5, 3.5, 1.0))), 4.0, 0)
        assert [one.share for one in saved] == [None, None]


def test_the_interval_shows_disagreement() -> None:
    one = ((5.0, 4.5, 3.5, 1.0), (5.0, 5.0, 5.0, 3.0))
    other = ((5.0, 4.5, 3.5, 1.0), (5.0, 4.5, 4.0, 3.0))
    rates = np.array([(RATES, RATES)] * 6)
    _, saved = savings(rates, study(*[one] * 6), 4.0, 0)
    assert (saved[1].low, saved[1].high) == (pytest.approx(0.4), pytest.approx(0.4))
    _, saved = savings(rates, study(*[one] * 3, *[other] * 3), 4.0, 0)
    assert saved[1].low is not None
    assert saved[1].high is not None
    assert saved[1].share is not None
    assert 0.2 <= saved[1].low < saved[1].share < saved[1].high <= 0.4
    assert savings(rates, study(*[one] * 3, *[other] * 3), 4.0, 0)[1] == saved  # seeded
