"""Truncated counters: expansion, replay window, loss meter."""

from collections.abc import Sequence
from itertools import pairwise
from random import Random

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from weberlink.protocol.counters import LOSS_PATIENCE, REPLAY_WINDOW, LossMeter, ReplayWindow, expand, expand_counter


@given(st.integers(0, 2**24 - 1), st.integers(-(2**40), 2**40))
def test_expansion_is_congruent_and_near(truncated: int, near: int) -> None:
    full = expand(truncated, 24, near)
    assert full % 2**24 == truncated
    assert abs(full - near) <= 2**23


@given(st.integers(0, 2**24 - 1), st.integers(0, 2**40))
@example(2**24 - 5, 0)
@example(2, 2**24 - 4)
def test_a_counter_never_becomes_negative(truncated: int, near: int) -> None:
    full = expand_counter(truncated, 24, near)
    assert full % 2**24 == truncated
    assert full == (expand(truncated, 24, near) if expand(truncated, 24, near) >= 0 else truncated)


@given(st.lists(st.integers(0, 3 * REPLAY_WINDOW), max_size=200))
@example([REPLAY_WINDOW, 0, 1])
@example([REPLAY_WINDOW - 1, 0])
@example([1, REPLAY_WINDOW + 1, 1, 2])
@example([5, 2**60, 5, 2**60, 2**60 - 1])
def test_each_number_is_new_once_and_old_ones_never(numbers: list[int]) -> None:
    window = ReplayWindow()
    marked: set[int] = set()
    for number in numbers:
        newest = max(marked, default=-1)
        assert window.newest == newest
        assert window.accept(number) == (number not in marked and newest - number < REPLAY_WINDOW)
        marked.add(number)
        assert not window.accept(number)


def meter(numbers: list[int]) -> LossMeter:
    made = LossMeter()
    changes = sum(made.record(number) for number in numbers)
    assert changes == made.lost
    return made


@given(st.sets(st.integers(0, 200), min_size=1))
def test_loss_in_order_is_the_number_of_gaps(received: set[int]) -> None:
    numbers = sorted(received)
    settled = [*numbers, *range(numbers[-1] + 1, numbers[-1] + 1 + LOSS_PATIENCE)]
    assert meter(settled).lost == numbers[-1] - numbers[0] + 1 - len(numbers)


@given(st.integers(0, 2**32), st.integers(2, 60))
def test_reordering_leaves_no_trace(seed: int, reach: int) -> None:
    """The averages are linear, so what comes late is taken back exactly."""
    random = Random(seed)
    numbers = list(range(1, 400))
    shuffled = sorted(numbers, key=lambda number: number + random.random() * reach)
    made = meter([0, *shuffled, *range(400, 400 + reach + LOSS_PATIENCE)])
    assert made.lost == 0
    assert made.fraction == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("loss", [0.01, 0.1, 0.5])
def test_the_estimate_follows_the_loss(loss: float) -> None:
    random = Random(3)
    made = LossMeter()
    estimates = []
    for number in range(20_000):
        if random.random() >= loss:
            made.record(number)
            estimates.append(made.fraction)
    late = estimates[5000:]
    mean = sum(late) / len(late)
    assert loss * 0.9 < mean < 1.2 * loss + 0.005, "the larger of two averages is a little too high"
    for number in range(20_000, 35_000):
        made.record(number)
    assert made.fraction < 1e-4


def test_burst_is_noticed_and_single_loss_remembered() -> None:
    made = meter([*range(100), *range(120, 124)])
    assert made.lost == 20
    assert made.fraction > 0.4
    single = meter([*range(100), *range(101, 600)])
    assert 1e-4 < single.fraction < 2e-3


@given(st.integers(0, 2**32), st.sampled_from([1, 2, 40]))
def test_burst_is_the_mean_length_of_the_gaps(seed: int, reach: int) -> None:
    """Whatever the order of arrival; up to the weights, which differ little over 150 numbers."""
    random = Random(seed)
    received = [0, 1, *(number for number in range(2, 151) if random.random() < 0.7), 151]
    order = sorted(received[1:], key=lambda number: number + random.random() * reach)
    made = meter([0, *order, *range(152, 153 + reach + LOSS_PATIENCE)])
    lengths = [after - before - 1 for before, after in pairwise(received) if after - before > 1]
    assert made.lost == sum(lengths)
    assert made.burst == pytest.approx(sum(lengths) / len(lengths), rel=0.08)


@pytest.mark.parametrize("numbers", [range(100), [*range(100), *range(140, 400), *range(440, 900)]])
def test_without_losses_or_with_rare_blackouts_there_are_no_bursts(numbers: Sequence[int]) -> None:
    assert meter(list(numbers)).burst == 0.0


def test_very_long_gap_stays_in_range() -> None:
    made = meter([0, 2**40, 2**40 + 1, 2**40 + 2, 2**40 + 3])
    assert made.lost == 2**40 - 1
    assert 0.9 < made.fraction <= 1.0


def test_bursts_have_a_mean_from_the_third_on() -> None:
    numbers = [*range(10), *range(12, 22), *range(24, 34)]
    assert meter(numbers).burst == 0.0
    assert meter([*numbers, *range(36, 46)]).burst == pytest.approx(2.0, rel=0.02)
