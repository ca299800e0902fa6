from math import floor
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.loss import CLEAN_INTERVAL, PATIENCE, SHORTEST_INTERVAL, LossMeter, heartbeat_interval


def meter(numbers: list[int]) -> LossMeter:
    made = LossMeter()
    changes = sum(made.record(number) for number in numbers)
    assert changes == made.lost
    return made


@given(st.sets(st.integers(0, 200), min_size=1))
def test_in_order_the_count_is_that_of_the_gaps(received: set[int]) -> None:
    numbers = sorted(received)
    settled = [*numbers, *range(numbers[-1] + 1, numbers[-1] + 1 + PATIENCE)]
    assert meter(settled).lost == numbers[-1] - numbers[0] + 1 - len(numbers)


@given(st.integers(0, 2**32), st.integers(2, 60))
def test_reordering_leaves_no_trace(seed: int, reach: int) -> None:
    """The averages are linear, so what comes late is taken back exactly."""
    random = Random(seed)
    numbers = list(range(1, 400))
    shuffled = sorted(numbers, key=lambda number: number + random.random() * reach)
    made = meter([0, *shuffled, *range(400, 400 + reach + PATIENCE)])
    assert made.lost == 0
    assert made.fraction == pytest.approx(0.0, abs=1e-9)


def test_a_swap_of_neighbours_is_never_seen_as_loss() -> None:
    made = LossMeter()
    for number in [0, 2, 1, 3, 5, 4, 6]:
        made.record(number)
        assert made.fraction == 0.0


def test_numbers_before_the_first_are_not_held_against_the_link() -> None:
    assert meter([1000, 1001, 998, 1002]).lost == 0


@pytest.mark.parametrize("loss", [0.01, 0.1, 0.5])
def test_the_estimate_follows_the_loss(loss: float) -> None:
    random = Random(3)
    made = LossMeter()
    estimates = []
    for number in range(50_000):
        if random.random() >= loss:
            made.record(number)
            estimates.append(made.fraction)
    late = estimates[5000:]
    mean = sum(late) / len(late)
    assert loss * 0.9 < mean < loss + 0.1
    for number in range(50_000, 65_000):
        made.record(number)
    assert made.fraction < 1e-4


def test_a_burst_is_noticed_at_once_and_a_single_loss_is_remembered() -> None:
    made = meter([*range(100), *range(120, 124)])
    assert made.lost == 20
    assert made.fraction > 0.4
    single = meter([*range(100), *range(101, 600)])
    assert 1e-4 < single.fraction < 2e-3


def test_a_very_long_gap_costs_no_time_and_stays_in_range() -> None:
    made = meter([0, 2**40, 2**40 + 1, 2**40 + 2, 2**40 + 3])
    assert made.lost == 2**40 - 1
    assert 0.9 < made.fraction <= 1.0


@given(st.floats(0.0, 0.6), st.floats(0.02, 1.0), st.floats(0.0, 0.002))
def test_false_alarms_stay_rarer_than_one_an_hour(loss: float, window: float, lateness: float) -> None:
    interval = heartbeat_interval(loss, window, lateness)
    assert SHORTEST_INTERVAL <= interval <= CLEAN_INTERVAL
    in_window = floor(window / (interval + lateness) + 1e-9)
    if interval > SHORTEST_INTERVAL:
        assert loss**in_window * 3600.0 / window < 1.0
        assert in_window >= 1


def test_the_densities_of_the_default_window() -> None:
    rates = [round(1.0 / heartbeat_interval(loss, 0.06, 0.0)) for loss in (0.0, 1e-3, 0.01, 0.1, 0.3, 1.0)]
    assert rates == [20, 33, 50, 83, 167, 500]
