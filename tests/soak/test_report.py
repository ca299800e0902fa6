"""What a report calls a failure, and what it does not."""

import json

import pytest

from tests.soak.processes import Footprint
from tests.soak.report import BOUNDS_PER_HOUR, Report
from tests.soak.watch import Samples


def samples(name: str, kib_per_hour: float, descriptors: int = 10) -> Samples:
    return Samples(
        name,
        [
            (float(t), Footprint(round(30_000 + kib_per_hour * t / 3600.0), 20_000 + 60 * t, 10_000, descriptors, 3))
            for t in range(1200)
        ],
    )


def test_a_clean_report_has_no_failures() -> None:
    report = Report(1, 60.0)
    report.kind("noise").count += 1
    report.measure([samples("master", 0.0), samples("slave", 100.0)])
    assert report.failures() == []
    assert report.growth["slave"]["rss_kib"] is not None
    assert report.growth["slave"]["rss_kib"].per_hour == pytest.approx(100.0, abs=5.0)
    assert report.held["master"] == [{"first": [30000, 20000, 10000, 10, 3], "last": [30000, 91940, 10000, 10, 3]}]
    assert json.loads(json.dumps(report.to_dict()))["failures"] == []


def test_a_daemon_that_grows_fails_and_the_relay_does_not() -> None:
    report = Report(1, 60.0)
    beyond = 3.0 * BOUNDS_PER_HOUR["rss_kib"]
    report.measure([samples("master", beyond), samples("relay", beyond)])
    (told,) = report.failures()
    assert told.startswith("master: rss_kib grew by 307")
    assert f"VIOLATED {told}" in report.lines()


def test_what_a_fault_broke_is_a_failure_of_its_kind() -> None:
    report = Report(1, 60.0)
    report.kind("stale").violations.append("output moved")
    report.kind("stale").notes["left out, why"] = 2
    report.violations.append("master: a deadline is off")
    assert report.failures() == ["master: a deadline is off", "stale: output moved"]
    assert "  left out, why: 2" in report.lines()


def test_short_runs_say_that_growth_cannot_be_told() -> None:
    report = Report(1, 1.0)
    report.measure([Samples("master", samples("master", 1e6).taken[:40])])
    assert report.failures() == []
    assert "master: too short to tell growth" in report.lines()
