"""Ratios, their mean and the law against the best single predictor, on rows made by hand."""

from math import sqrt

import pytest

from weberlink.studies.adaptive.comparison import Ratio, against_best, against_best_ratios, geometric_mean, ratios
from weberlink.studies.adaptive.rows import Rate
from weberlink.studies.adaptive.work import RATES


def row(signal: str, variant: str, packets: int, duration_s: float = 10.0) -> Rate:
    group = signal.partition(",")[0]
    return Rate(RATES, signal, group, "reported", "scene", 0.0, variant, 0.02, packets, packets / duration_s)


def test_a_ratio_is_packets_over_packets_on_the_same_signal() -> None:
    rows = [row("a", "ours", 50), row("a", "theirs", 100), row("b", "ours", 30), row("b", "theirs", 10)]
    assert ratios(rows, "ours", "theirs") == [Ratio("a", "a", 0.5), Ratio("b", "b", 3.0)]


def test_a_signal_without_a_packet_of_either_says_nothing() -> None:
    rows = [
        row("silent", "ours", 0),
        row("silent", "theirs", 0),
        row("half", "ours", 0),
        row("half", "theirs", 4),
        row("alone", "ours", 4),
    ]
    assert ratios(rows, "ours", "theirs") == []
    assert geometric_mean([]) is None


def test_the_mean_is_geometric_and_lies_within_its_confidence() -> None:
    mean = geometric_mean([Ratio("a", "a", 0.5), Ratio("b", "b", 2.0), Ratio("c", "c", 1.0)])
    assert mean is not None
    assert mean.mean == pytest.approx(1.0)
    assert mean.low < 1.0 < mean.high
    assert mean.low >= 0.5
    assert mean.high <= 2.0


def test_seeds_of_one_scene_are_one_group_however_many_they_are() -> None:
    alike = [Ratio(f"plane, seed {seed}", "plane", 0.25) for seed in range(9)]
    mean = geometric_mean([*alike, Ratio("ball, seed 1", "ball", 1.0)])
    assert mean is not None
    assert mean.mean == pytest.approx(0.5)
    one = geometric_mean([Ratio("plane, seed 1", "plane", 0.2), Ratio("plane, seed 2", "plane", 0.8)])
    assert one is not None
    # A single group says nothing of others: no confidence comes from its seeds.
    assert (one.low, one.mean, one.high) == pytest.approx((0.4, 0.4, 0.4))


def test_the_confidence_narrows_with_groups() -> None:
    def width(groups: int) -> float:
        mean = geometric_mean([Ratio(str(n), str(n), (0.5, 2.0)[n % 2]) for n in range(groups)])
        assert mean is not None
        return mean.high / mean.low

    assert width(40) < sqrt(width(4))


def test_the_bootstrap_is_the_same_every_time() -> None:
    found = [Ratio(str(n), str(n), 0.5 + 0.1 * n) for n in range(7)]
    assert geometric_mean(found) == geometric_mean(found[::-1])


@pytest.mark.parametrize(
    ("mine", "best", "within"),
    [(210, 200, True), (211, 200, False), (104, 99, True), (110, 99, False), (60, 50, True), (61, 50, False)],
)
def test_the_law_is_a_ratio_for_busy_signals_and_a_difference_for_quiet_ones(
    mine: int, best: int, *, within: bool
) -> None:
    rows = [row("a", "adaptive", mine), row("a", "zoh", best), row("a", "linear", 400)]
    (found,) = against_best(rows, "adaptive", ("linear", "zoh"))
    assert (found.single, found.within) == ("zoh", within)


def test_a_signal_that_lacks_a_single_predictor_is_not_judged() -> None:
    rows = [row("a", "adaptive", 10), row("a", "zoh", 20), row("b", "adaptive", 10)]
    assert against_best(rows, "adaptive", ("zoh", "linear")) == []
    (only,) = against_best(rows, "adaptive", ("zoh",))
    assert against_best_ratios([only]) == [Ratio("a", "a", 0.5)]
