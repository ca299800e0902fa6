"""sockperf's log of a real run, and the program itself where it is installed."""

from pathlib import Path

import pytest

from benchmarks.arrangement import BenchError
from benchmarks.rights import Rights
from benchmarks.sockperf import measure, parse, version

CAPTURED = (Path(__file__).parent / "captured" / "sockperf.csv").read_text(encoding="utf-8")
"""Of version 3.7: 33 round trips."""


def test_every_round_trip_of_the_log_is_read() -> None:
    trips = parse(CAPTURED)
    assert len(trips) == 33
    assert trips[-2:].tolist() == pytest.approx([92.357, 316.697], abs=1e-2)
    assert all(trips > 0.0)


@pytest.mark.parametrize("text", ["", "sockperf: ERROR\n", "packet, txTime(sec), rxTime(sec), rtt(usec)\n"])
def test_a_log_without_observations_is_one_line(text: str) -> None:
    with pytest.raises(BenchError, match="no observations"):
        parse(text)


@pytest.mark.skipif(version() is None, reason="sockperf is not installed")
def test_the_installed_one_is_understood() -> None:
    assert str(version()).startswith("sockperf ")
    trips = measure(48, 1.0, Rights(priority=0, lock_memory=False, wakeful=False, cpus=None))
    assert len(trips) > 10
    assert all(trips > 0.0)
