"""What is made of measurements, of the output of other programs, and of the facts of the host."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from benchmarks.arrangement import BenchError
from benchmarks.figures import exceedance
from benchmarks.latency import CAME, SENT, trips
from benchmarks.live_side import LiveSide
from benchmarks.pairs import A, B, compare
from benchmarks.percentiles import NAMES, PERCENTILES, percentile, ratio, ratios, summary
from benchmarks.programs import parse_histogram
from tests.records import ticks

CAPTURED = Path(__file__).parent / "captured"
CYCLICTEST = (CAPTURED / "cyclictest.txt").read_text(encoding="utf-8")
"""Of version 2.40: two threads, 400 cycles each, bins up to 60 us, three latencies beyond them."""
TWO_THREADS = """# Histogram
000003 000001\t000002
000007 000000\t000001
# Total: 000000001 000000003
# Max Latencies: 00003 00050
# Histogram Overflows: 00000 00002
"""


@given(
    st.lists(st.floats(0.0, 1e6), min_size=1, max_size=50), st.sampled_from([*PERCENTILES.values(), 0.1, 33.0, 100.0])
)
def test_percentiles_are_nearest_rank(values: list[float], p: float) -> None:
    ordered = sorted(values)
    enough = [value for value in ordered if sum(each <= value for each in ordered) * 100.0 >= p * len(ordered) - 1e-6]
    assert percentile(np.array(ordered), p) == enough[0]


def test_rounding_moves_no_rank_and_a_ratio_is_to_the_limit() -> None:
    assert percentile(np.arange(1.0, 751.0), 4.4) == 33.0
    values = np.random.default_rng(1).permutation(np.arange(1.0, 10_001.0))
    assert summary(values) == {"p50": 5000.0, "p90": 9000.0, "p99": 9900.0, "p99_9": 9990.0, "max": 10_000.0}
    assert (ratio(3.0, 2.0), ratio(3.0, 0.0), ratio(3.0, None), ratio(None, 2.0)) == (1.5, None, None, None)
    assert ratios(summary([4.0]), summary([2.0])) == dict.fromkeys(NAMES, 2.0)
    found, shares = exceedance([5.0, 2.0, 2.0, 9.0])
    assert found == pytest.approx([2.0, 5.0, 9.0], rel=0.003)
    assert shares == pytest.approx([1.0, 0.5, 0.25])


def test_every_cycle_of_every_thread_is_counted() -> None:
    seen = parse_histogram(CYCLICTEST)
    assert (seen.threads, len(seen.latencies_us), seen.latencies_us[0]) == (2, 800, 16.0)
    assert list(seen.latencies_us[-3:]) == [84.0, 84.0, 7297.0]  # what has no bin counts as the latest of its thread
    assert np.count_nonzero(seen.latencies_us < 60.0) == 399 + 398
    assert parse_histogram(TWO_THREADS).latencies_us.tolist() == [3.0, 3.0, 3.0, 7.0, 50.0, 50.0]


@pytest.mark.parametrize(
    "text", ["", "# Histogram\n000001 000001\t000002\n", "000001 000001\n# Total: 000000001 000000001\n"]
)
def test_output_without_a_measurement_is_an_error(text: str) -> None:
    with pytest.raises(BenchError):
        parse_histogram(text)


@pytest.mark.parametrize(
    ("rate_hz", "late", "missed", "counted"),
    [
        (1000.0, [40.0, 50.0, 300.0, 60.0], [7, 7, 17, 17], [40.0, 50.0, 10_300.0, 60.0]),
        (4000.0, [40.0, 50.0], [0, 2], [40.0, 550.0]),
    ],
)
def test_a_stall_counts_from_the_oldest_deadline(
    rate_hz: float, late: list[float], missed: list[int], counted: list[float]
) -> None:
    records = ticks(len(late), lateness_us=late, ticks_missed=missed)
    assert LiveSide(records, rate_hz, []).lateness_us.tolist() == counted


def test_trips_are_from_the_one_end_to_the_other_without_warm_up() -> None:
    """The datagram 400 warms up, 701 did not arrive, and no way needs that the other end sends in the same ticks."""
    asked = {SENT: {400: 0, 700: 1_000_000, 701: 2_000_000, 702: 3_000_000}, CAME: {450: 60_000, 703: 4_050_000}}
    answered = {SENT: {450: 0, 703: 4_000_000, 704: 5_000_000}, CAME: {400: 50_000, 700: 1_040_000, 702: 3_020_000}}
    found = trips(asked, answered)
    assert {way: times.tolist() for way, times in found.items()} == {"position": [40.0, 20.0], "force": [50.0]}
    with pytest.raises(BenchError, match="no force"):
        trips(asked, {SENT: {}, CAME: answered[CAME]})


def test_ratios_are_of_the_same_pair() -> None:
    work, missed = compare(
        [
            {A: {"work [us]": 100.0, "missed [%]": 0.0}, B: {"work [us]": 50.0, "missed [%]": 0.1}},
            {A: {"work [us]": 400.0, "missed [%]": 0.0}, B: {"work [us]": 240.0, "missed [%]": 0.0}},
            {A: {"work [us]": 100.0, "missed [%]": 0.2}, B: {"work [us]": 80.0, "missed [%]": 0.1}},
        ]
    )
    assert (work["a"], work["b"]) == (100.0, 80.0)
    assert [work[name] for name in ("ratio", "least", "most")] == pytest.approx([0.6, 0.5, 0.8])
    assert [missed[name] for name in ("a", "b", "ratio", "least", "most")] == pytest.approx([0.0, 0.1, 0.5, 0.5, 0.5])
