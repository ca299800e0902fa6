from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.protocol.loss import (
    LOSSY,
    MOST_COPIES,
    PATIENCE,
    RESIDUAL,
    LossMeter,
    copies_needed,
)


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


@given(st.floats(0.0, 1.0))
def test_copies_leave_little_lost(loss: float) -> None:
    copies = copies_needed(loss)
    assert 0 <= copies <= MOST_COPIES
    assert loss <= LOSSY or copies == MOST_COPIES or loss ** (1 + copies) <= RESIDUAL * (1.0 + 1e-6)
    assert copies == 0 or loss**copies > RESIDUAL * (1.0 - 1e-6)


def test_a_clean_link_needs_no_copies() -> None:
    assert [copies_needed(loss) for loss in (0.0, LOSSY, 0.01, 0.1, 0.3, 1.0)] == [0, 0, 0, 1, 3, 3]
