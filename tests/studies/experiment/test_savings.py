"""Packets at equal quality, on curves whose crossings are known."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.studies.experiment.savings import Crossing, Reach, crossing, falling, savings

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
def test_falling_falls_keeps_the_mean_and_changes_nothing_that_falls(values: list[float]) -> None:
    smooth = falling(values)
    assert all(a >= b - 1e-12 for a, b in pairwise(smooth))
    assert np.mean(smooth) == pytest.approx(np.mean(values))
    ordered = sorted(values, reverse=True)
    assert falling(ordered) == ordered


@given(levels, st.floats(0.0, 5.0), st.floats(0.0, 5.0))
def test_a_higher_level_never_needs_fewer_packets(ratings: list[float], one: float, other: float) -> None:
    rates = [100.0 / (place + 1) for place in range(len(ratings))]
    low, high = (crossing(rates, ratings, level).packets_per_s for level in sorted((one, other)))
    if high is not None:
        assert low is not None
        assert low <= high + 1e-9


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


def test_nothing_is_said_against_a_base_that_does_not_come_to_the_level() -> None:
    for base in ((3.0, 2.0, 1.0, 0.0), (5.0, 5.0, 5.0, 5.0)):
        _, saved = savings(study((RATES, RATES)), study((base, (5.0, 4.5, 3.5, 1.0))), 4.0, 0)
        assert [one.share for one in saved] == [None, None]


def test_subjects_who_agree_leave_no_doubt_and_others_do() -> None:
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
