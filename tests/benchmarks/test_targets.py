"""What is to be reached, at its bound and beyond it, judged by the worse daemon."""

import pytest

from benchmarks.targets import Target, targets
from tests.benchmarks.findings import latency, lateness


def judged(**values: Target) -> dict[str, tuple[float | None, bool | None]]:
    return {name: (target.value, target.met) for name, target in values.items()}


def test_the_later_daemon_and_the_slower_way_count() -> None:
    rates = {
        1000.0: lateness(1000.0, late_us=40.0, missed=10, cpu_s=1.199),
        4000.0: lateness(4000.0, missed=400),
    }
    found = {target.name: target for target in targets(rates, latency(120.0, 150.0))}
    assert judged(**found) == {
        "lateness_p99_ratio_1khz": (pytest.approx(2.0), True),
        "missed_share_1khz": (pytest.approx(0.001), True),
        "missed_share_4khz": (pytest.approx(0.01), True),
        "cpu_share_1khz": (pytest.approx(0.1199), True),
        "one_way_p50_ratio": (pytest.approx(3.0), True),
    }


def test_a_little_worse_is_missed() -> None:
    rates = {
        1000.0: lateness(1000.0, late_us=40.1, missed=11, cpu_s=1.21),
        4000.0: lateness(4000.0, missed=401),
    }
    found = targets(rates, latency(120.0, 150.1))
    assert [target.met for target in found] == [False] * 5


def test_what_was_not_measured_is_neither_met_nor_missed() -> None:
    found = {target.name: target for target in targets({1000.0: lateness(1000.0)}, latency())}
    assert found["missed_share_4khz"].met is None
    assert found["missed_share_4khz"].as_json() == {
        "name": "missed_share_4khz", "value": None, "target": 0.01, "at_least": False, "met": None,
    }  # fmt: skip
