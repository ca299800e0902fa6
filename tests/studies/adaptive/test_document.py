"""Ratios, targets and the page, from rows that can be checked by hand."""

from dataclasses import replace

import pytest

from weberlink.studies.adaptive.comparison import (
    AdaptiveResults,
    CostRow,
    MatchRow,
    RateRow,
    SignalRatio,
    against_best,
    geometric_mean,
    ratios,
)
from weberlink.studies.adaptive.document import document
from weberlink.studies.adaptive.signals import QUICK, Half, Kind
from weberlink.studies.adaptive.targets import targets
from weberlink.studies.adaptive.variants import ABLATIONS, COMPARED, TUNINGS
from weberlink.studies.adaptive.work import ABLATION, LIMITS, RATES, TUNING, UNSEEN

SIGNALS: tuple[tuple[str, str, Half, Kind], ...] = (
    ("omega3_1", "omega3_1", "chosen", "recording"),
    ("omega3_7", "omega3_7", "reported", "recording"),
    ("plane_friction, seed 1", "plane_friction", "chosen", "scene"),
    ("plane_friction, seed 2", "plane_friction", "reported", "scene"),
    ("plane_friction, seed 3", "plane_friction", "reported", "scene"),
    ("plane_moving, seed 2", "plane_moving", "reported", "scene"),
)
PACKETS = {"hybrid": 200, "adaptive": 100, "zoh": 400, "linear": 300, "plane": 250, "sphere": 500}
DURATION_S = 10.0


def rate(part: str, signal: tuple[str, str, Half, Kind], variant: str, packets: int, floor: float = 0.02) -> RateRow:
    return RateRow(part, *signal, 0.0, variant, floor, packets, packets / DURATION_S)


def match(signal: tuple[str, str, Half, Kind], variant: str, weber: float, error: float, step: float) -> MatchRow:
    return MatchRow(*signal, variant, weber, 200, 20.0, error, 10.0 * error, step, 10.0 * step)


def results() -> AdaptiveResults:
    """`adaptive` sends half of what the hybrid sends, and at equal packets errs half as much."""
    made = AdaptiveResults()
    for signal in SIGNALS:
        made.rates.extend(rate(RATES, signal, name, PACKETS.get(name, 150)) for name in COMPARED)
        if signal[2] == "reported":
            made.rates.extend(rate(ABLATION, signal, name, 110) for name in ABLATIONS)
            made.rates.append(rate(LIMITS, signal, "hybrid", 40))
            made.matches.append(match(signal, "hybrid", 0.10, 0.04, 0.2))
            made.matches.append(match(signal, "adaptive", 0.05, 0.02, 0.1))
        else:
            made.rates.extend(rate(TUNING, signal, name, 101) for name in TUNINGS)
    further: tuple[str, str, Half, Kind] = ("plane_friction, seed 4", "plane_friction", "reported", "scene")
    made.rates.extend(rate(UNSEEN, further, name, packets) for name, packets in (("hybrid", 200), ("adaptive", 200)))
    for name in ("hybrid", "adaptive"):
        made.rates.append(rate(RATES, SIGNALS[1], name, PACKETS[name] - 10, 0.05))
    made.costs.extend(
        [CostRow("hybrid", 1000, 6.0, 7.0, 12.0, 90.0), CostRow("adaptive", 1000, 30.0, 35.0, 70.0, 400.0)]
    )
    return made


@pytest.fixture(scope="module")
def page() -> str:
    return document(results(), QUICK, "made here", drawn=True)


def section(page: str, title: str) -> str:
    """From a heading to the next of any level."""
    _, _, rest = page.partition(f"# {title}\n")
    assert rest, title
    return rest.partition("\n#")[0]


def test_targets_are_judged_by_the_rows(page: str) -> None:
    met = [one.met for one in targets(results())]
    # Friction: halves at two seeds, and a further seed on which it saves nothing, so (0.5 * 0.5 * 1)^(1/3) = 0.63.
    assert met == [True, True, True, True, False, None, True, True, True]
    table = section(page, "Targets")
    assert table.count("| met |") == 7
    assert "| 0.630 (0.50 to 1.00, 3 seeds) | **not met** |" in table
    assert "| 0.500 (0.500 to 0.500) | met |" in table
    assert "median 30, mean 35, p99 70 us" in table


def test_a_broken_law_is_reported(page: str) -> None:
    assert "0 ticks outside in" in page
    broken = results()
    broken.rates[0] = replace(broken.rates[0], outside=3)
    assert "3 ticks outside in" in document(broken, QUICK, "", drawn=False)
    assert [one.met for one in targets(broken)].count(False) == 2


def test_rates_and_ratios_are_those_of_the_rows(page: str) -> None:
    assert "| omega3_7 | 20.0 | 10.0 | 40.0 | 30.0 | 25.0 | 50.0 | 15.0 | 15.0 | 15.0 | 0.50 | 0.40 |" in page
    means = section(page, "Packets")
    assert "| held-out half, floor 0.02 N | 4 | 0.50 (0.50 to 0.50) | 0.40 (0.40 to 0.40) |" in means


def test_published_counts_stand_beside_ours(page: str) -> None:
    assert "| omega3_7 | 31.6 | 19.0 | 9.0 | 0.47 |" in section(page, "Floor 0.05 N")


def test_tables_show_the_numbers_of_the_rows(page: str) -> None:
    assert "| no surface | 1.10 (1.10 to 1.10) |" in section(page, "What each part is worth")
    felt = section(page, "At equal packets")
    assert "| omega3_7 | 20.0, 20.0 | 0.050 | 0.0400, 0.0200 | 0.40, 0.20 | 0.200, 0.100 | 2.00, 1.00 |" in felt
    assert "| omega3_7 | - | - | 4.0 | 20.0 | 10.0 |" in section(page, "The clairvoyant limit")
    assert "| adaptive | 1000 | 30.0 | 35.0 | 70 | 400 |" in section(page, "Cost")
    assert page.endswith("---\nmade here\n")


def test_losses_are_named(page: str) -> None:
    assert "It sends more than the hybrid on 0 of 4 signals." in page
    worse = results()
    index = next(i for i, row in enumerate(worse.rates) if (row.signal, row.variant) == ("omega3_7", "adaptive"))
    worse.rates[index] = replace(worse.rates[index], packets=280, packets_per_s=28.0)
    told = section(document(worse, QUICK, "", drawn=False), "Where it loses")
    assert "more than the hybrid on 1 of 4 signals: omega3_7 (28.0 against 20.0/s)." in told
    assert "on 1 of 4 signals: omega3_7 (28.0 against 25.0/s of plane)." in told


def test_a_study_without_rows_makes_a_page() -> None:
    assert {one.met for one in targets(AdaptiveResults())} == {None}
    assert "not measured" in document(AdaptiveResults(), QUICK, "nothing", drawn=False)


def test_one_mean_leaves_out_quiet_signals(page: str) -> None:
    line = "| of these, where hybrid sends 5/s or more | {} |"
    assert line.format(4) in page
    quiet = results()
    quiet.rates[:] = [
        replace(row, packets=row.packets // 10, packets_per_s=row.packets_per_s / 10)
        if row.signal == "omega3_7"
        else row
        for row in quiet.rates
    ]
    assert line.format(3) in document(quiet, QUICK, "", drawn=False)


def row(signal: str, variant: str, packets: int, duration_s: float = 10.0) -> RateRow:
    group = signal.partition(",")[0]
    return RateRow(RATES, signal, group, "reported", "scene", 0.0, variant, 0.02, packets, packets / duration_s)


def test_a_ratio_compares_packets_of_one_signal() -> None:
    rows = [row("a", "ours", 50), row("a", "theirs", 100), row("b", "ours", 30), row("b", "theirs", 10)]
    assert ratios(rows, "ours", "theirs") == [SignalRatio("a", "a", 0.5), SignalRatio("b", "b", 3.0)]


def test_a_signal_without_packets_has_no_ratio() -> None:
    rows = [
        row("silent", "ours", 0),
        row("silent", "theirs", 0),
        row("half", "ours", 0),
        row("half", "theirs", 4),
        row("alone", "ours", 4),
    ]
    assert ratios(rows, "ours", "theirs") == []
    assert geometric_mean([]) is None


def test_the_mean_is_geometric_and_within_its_interval() -> None:
    mean = geometric_mean([SignalRatio("a", "a", 0.5), SignalRatio("b", "b", 2.0), SignalRatio("c", "c", 1.0)])
    assert mean is not None
    assert mean.mean == pytest.approx(1.0)
    assert mean.low < 1.0 < mean.high
    assert mean.low >= 0.5
    assert mean.high <= 2.0


def test_seeds_of_one_scene_are_one_group() -> None:
    alike = [SignalRatio(f"plane, seed {seed}", "plane", 0.25) for seed in range(9)]
    mean = geometric_mean([*alike, SignalRatio("ball, seed 1", "ball", 1.0)])
    assert mean is not None
    assert mean.mean == pytest.approx(0.5)
    one = geometric_mean([SignalRatio("plane, seed 1", "plane", 0.2), SignalRatio("plane, seed 2", "plane", 0.8)])
    assert one is not None
    # A single group says nothing of others: no confidence comes from its seeds.
    assert (one.low, one.mean, one.high) == pytest.approx((0.4, 0.4, 0.4))


@pytest.mark.parametrize(
    ("mine", "best", "within"),
    [(210, 200, True), (211, 200, False), (104, 99, True), (110, 99, False), (60, 50, True), (61, 50, False)],
)
def test_the_limit_depends_on_the_packet_rate(mine: int, best: int, *, within: bool) -> None:
    rows = [row("a", "adaptive", mine), row("a", "zoh", best), row("a", "linear", 400)]
    (found,) = against_best(rows, "adaptive", ("linear", "zoh"))
    assert (found.single, found.within) == ("zoh", within)
