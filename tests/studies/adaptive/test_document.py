"""The page from fixed rows: every number of it can be worked out by hand."""

from dataclasses import replace

import pytest

from tests.studies.adaptive.fixed import results
from weberlink.studies.adaptive.document import document
from weberlink.studies.adaptive.rows import Results
from weberlink.studies.adaptive.signals import QUICK
from weberlink.studies.adaptive.verdict import targets
from weberlink.studies.adaptive.words import FIGURES


@pytest.fixture(scope="module")
def page() -> str:
    return document(results(), QUICK, "made here", drawn=True)


def section(page: str, title: str) -> str:
    """From a heading to the next of any level."""
    _, _, rest = page.partition(f"# {title}\n")
    assert rest, title
    return rest.partition("\n#")[0]


def test_every_target_is_judged_by_the_rows(page: str) -> None:
    met = [one.met for one in targets(results())]
    # Friction: halves at two seeds, and a further seed on which it saves nothing, so (0.5 * 0.5 * 1)^(1/3) = 0.63.
    assert met == [True, True, True, True, False, None, True, True, True]
    table = section(page, "What it was to show")
    assert table.count("| met |") == 7
    assert "| 0.630 (0.50 to 1.00, 3 seeds) | **not met** |" in table
    assert "| 0.500 (0.500 to 0.500) | met |" in table
    assert "median 30, mean 35, p99 70 us" in table


def test_a_broken_law_is_told(page: str) -> None:
    assert "0 ticks outside in" in page
    broken = results()
    broken.rates[0] = replace(broken.rates[0], outside=3)
    assert "3 ticks outside in" in document(broken, QUICK, "", drawn=False)
    assert [one.met for one in targets(broken)].count(False) == 2


def test_rates_and_ratios_are_those_of_the_rows(page: str) -> None:
    assert "| omega3_7 | 20.0 | 10.0 | 40.0 | 30.0 | 25.0 | 50.0 | 15.0 | 15.0 | 15.0 | 0.50 | 0.40 |" in page
    means = section(page, "Packets")
    assert "| half that chose nothing, floor 0.02 N | 4 | 0.50 (0.50 to 0.50) | 0.40 (0.40 to 0.40) |" in means


def test_counts_of_others_stand_beside_ours_at_their_floor(page: str) -> None:
    assert "| omega3_7 | 31.6 | 19.0 | 9.0 | 0.47 |" in section(page, "Floor 0.05 N")


def test_parts_and_equal_packets_and_limits_are_those_of_the_rows(page: str) -> None:
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


def test_figures_are_shown_where_they_are_drawn(page: str) -> None:
    for name in FIGURES:
        assert f"]({name}.png)" in page
    assert ".png" not in document(results(), QUICK, "", drawn=False)


def test_a_study_without_rows_is_a_page_all_the_same() -> None:
    assert {one.met for one in targets(Results())} == {None}
    assert "not measured" in document(Results(), QUICK, "nothing", drawn=False)


def test_signals_of_few_packets_are_left_out_of_one_mean(page: str) -> None:
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
