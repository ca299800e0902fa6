"""Ratios and their means: what counts once, which intervals, and what a loss is."""

from dataclasses import replace

import pytest

from weberlink.codec.predictors import ADAPTIVE, HYBRID
from weberlink.studies.adaptive.coding import SINGLES, RateRow
from weberlink.studies.adaptive.comparison import by_group, interval, over_sources, ratios, run_times

ROW = RateRow("a1", "a", "s", "recording", 1000, ADAPTIVE, 10.0, 100, 4000, 0.5, 0, 60.0, 1.0)


def rows(signal: str, group: str, adaptive: int, hybrid: int, best: int, **fields: object) -> list[RateRow]:
    packets = {ADAPTIVE: adaptive, HYBRID: hybrid, **dict.fromkeys(SINGLES, 2 * best), SINGLES[1]: best}
    row = replace(ROW, signal=signal, group=group, **fields)
    return [replace(row, predictor=name, packets=count) for name, count in packets.items()]


def test_the_best_single_is_that_of_the_signal() -> None:
    (found,) = ratios(rows("a1", "a", 120, 100, 80))
    assert (found.over_hybrid, found.over_best, found.best) == (pytest.approx(1.2), pytest.approx(1.5), SINGLES[1])
    assert found.lost


def test_one_packet_per_second_more_is_no_loss() -> None:
    listed = [*rows("a1", "a", 29, 29, 20), *rows("a2", "a", 31, 31, 20), *rows("a3", "a", 1040, 1, 1000)]
    assert [one.lost for one in ratios(listed)] == [False, True, False]
    (group,) = by_group(ratios(listed))
    assert (group.above, group.lost) == (pytest.approx(2 / 3), pytest.approx(1 / 3))
    assert group.worst == (pytest.approx(1.55), "a2")


def test_no_packets_have_a_ratio() -> None:
    (found,) = ratios(rows("a1", "a", 2, 0, 0))
    assert (found.over_hybrid, found.over_best) == (2.0, 2.0)


def test_rates_and_groups_are_apart() -> None:
    listed = [
        *rows("a1", "a", 50, 100, 100),
        *rows("b1", "b", 100, 100, 100),
        *rows("a1", "a", 80, 100, 100, rate_hz=500),
    ]
    found = {(one.name, one.rate_hz): one.over_hybrid.mean for one in by_group(ratios(listed))}
    assert found == {("a", 1000): pytest.approx(0.5), ("b", 1000): 1.0, ("a", 500): pytest.approx(0.8)}


def test_every_source_counts_once() -> None:
    many = [row for number in range(9) for row in rows(f"a{number}", "a", 50, 100, 100, source="a")]
    found = over_sources(ratios([*many, *rows("b1", "b", 200, 100, 100, source="b")]), "both", 1000, ["a", "b", "c"])
    assert found is not None
    assert (found.over_hybrid.mean, found.signals) == (pytest.approx(1.0), 10)
    assert over_sources([], "none", 1000, ["a"]) is None


def test_an_interval_is_that_of_the_signals() -> None:
    alone = interval([[0.7]])
    assert alone == pytest.approx((0.7, 0.7, 0.7))
    two = interval([[0.5, 2.0]])
    assert two == pytest.approx((1.0, 0.5, 2.0))
    few, many = interval([[0.8, 1.25] * 3]), interval([[0.8, 1.25] * 30])
    assert few.low < many.low < 1.0 < many.high < few.high
    assert interval([[0.8, 1.25] * 3]) == few


def test_run_times_are_medians_at_one_rate() -> None:
    listed = [replace(ROW, signal=str(us), tick_us=us) for us in (10.0, 20.0, 90.0)]
    assert run_times([*listed, replace(ROW, rate_hz=500, tick_us=1.0)], 1000) == {ADAPTIVE: 20.0}
