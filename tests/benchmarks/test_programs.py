"""Command lines and output of cyclictest and sockperf."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.arrangement import BenchError, Rights
from benchmarks.percentiles import summary
from benchmarks.programs import (
    cyclictest,
    cyclictest_line,
    cyclictest_version,
    parse_histogram,
    parse_trips,
    sockperf,
    sockperf_version,
)

CYCLICTEST = (Path(__file__).parent / "captured" / "cyclictest.txt").read_text(encoding="utf-8")
"""Of version 2.40: two threads, 400 cycles each, bins up to 60 us, three latencies beyond them."""
BARE = Rights(priority=0, lock_memory=False, wakeful=False, cpus=None)


def test_every_cycle_of_every_thread_is_counted() -> None:
    seen = parse_histogram(CYCLICTEST)
    assert seen.threads == 2
    assert len(seen.latencies_us) == 800
    assert seen.latencies_us[0] == 16.0
    assert list(seen.latencies_us[-3:]) == [84.0, 84.0, 7297.0]  # what has no bin counts as the latest of its thread
    assert np.count_nonzero(seen.latencies_us < 60.0) == 399 + 398


def test_histogram_counts_become_latencies() -> None:
    text = "# Histogram\n000003 000001\t000002\n000007 000000\t000001\n# Total: 000000001 000000003\n"
    text += "# Max Latencies: 00003 00050\n# Histogram Overflows: 00000 00002\n"
    assert parse_histogram(text).latencies_us.tolist() == [3.0, 3.0, 3.0, 7.0, 50.0, 50.0]
    assert summary(parse_histogram(text).latencies_us)["max"] == 50.0


@pytest.mark.parametrize(
    "text",
    [
        "",
        "cyclictest: unable to set scheduler",
        "# Histogram\n000001 000001\t000002\n",
        "000001 000001\n# Total: 000000001 000000001\n",
    ],
)
def test_output_without_histogram_is_one_line(text: str) -> None:
    with pytest.raises(BenchError, match="no histogram"):
        parse_histogram(text)


def test_cyclictest_has_the_daemons_rights() -> None:
    whole = Rights(priority=50, lock_memory=True, wakeful=True, cpus=(3, 2))
    line = " ".join(cyclictest_line(4000.0, 5.0, whole, threads=2))
    for part in ("-t 2", "-i 250", "-l 20000", "--policy=fifo", "-p 50", "-m", "-a 2,3"):
        assert f" {part}" in line
    assert "--default-system" not in line


def test_cyclictest_takes_no_further_rights() -> None:
    line = cyclictest_line(1000.0, 1.0, BARE, threads=2)
    assert "--policy=other" in line
    assert "--default-system" in line
    assert not {"-p", "-m", "-a"} & set(line)


@pytest.mark.skipif(cyclictest_version() is None, reason="cyclictest is not installed")
def test_installed_cyclictest_is_understood() -> None:
    assert str(cyclictest_version()).startswith("cyclictest ")
    seen = cyclictest(cyclictest_line(1000.0, 0.1, BARE, threads=2), 0.1)
    assert seen.threads == 2
    assert 100 <= len(seen.latencies_us) <= 200  # the first thread to be done ends the other


SOCKPERF = (Path(__file__).parent / "captured" / "sockperf.csv").read_text(encoding="utf-8")
"""Of version 3.7: 33 round trips."""


def test_every_round_trip_of_the_log_is_read() -> None:
    trips = parse_trips(SOCKPERF)
    assert len(trips) == 33
    assert trips[-2:].tolist() == pytest.approx([92.357, 316.697], abs=1e-2)
    assert all(trips > 0.0)


@pytest.mark.parametrize("text", ["", "sockperf: ERROR\n", "packet, txTime(sec), rxTime(sec), rtt(usec)\n"])
def test_a_log_without_observations_is_one_line(text: str) -> None:
    with pytest.raises(BenchError, match="no observations"):
        parse_trips(text)


@pytest.mark.hunt
@pytest.mark.skipif(sockperf_version() is None, reason="sockperf is not installed")
def test_installed_sockperf_is_understood() -> None:
    assert str(sockperf_version()).startswith("sockperf ")
    trips = sockperf(48, 1.0, Rights(priority=0, lock_memory=False, wakeful=False, cpus=None))
    assert len(trips) > 10
    assert all(trips > 0.0)
