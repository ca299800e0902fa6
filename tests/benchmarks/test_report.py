"""The report, its targets and its figure."""

import json
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from benchmarks.arrangement import RATES_HZ
from benchmarks.figures import exceedance
from benchmarks.latency import Trips
from benchmarks.lateness import Lateness
from benchmarks.report import targets
from benchmarks.study import assemble
from tests.benchmarks.findings import ARRANGEMENT, findings, latency, lateness
from weberlink.studies.result import StudyResult


def printed(bench: StudyResult) -> list[str]:
    screen = StringIO()
    Console(width=80, file=screen).print(bench.table)
    return screen.getvalue().splitlines()


def row(lines: list[str], name: str) -> list[str]:
    """The words of a row, after its name."""
    (line,) = [line for line in lines if line.startswith(name)]
    return line.removeprefix(name).split()


def test_every_figure_stands_beside_its_limit() -> None:
    lines = printed(assemble(ARRANGEMENT, findings()))
    assert row(lines, "1 kHz slave") == ["30.0", "30.0", "30.0", "30.0", "30.0", "0.000", "%"]
    assert row(lines, "1 kHz cyclictest 2.40") == [*["20.0"] * 5, "0.000", "%"]
    assert row(lines, "4 kHz both, x limit") == ["0.75", "1.5", "1.5", "1.5", "1.5"]
    assert row(lines, "force, x plain") == ["2.4"] * 5
    assert row(lines, "round trip, x sockperf") == ["5.5"] * 5
    assert row(lines, "receive, caches cold") == ["88.0"] * 5
    assert row(lines, "force, x sealed") == ["1.2"] * 5
    text = "\n".join(lines)
    for said in (
        "200 thousand samples/s",
        "master: 5.0 % of a core at 1 kHz, 50 us a tick; p50: work 50.0, codec 5.0 us",
        "steal during the run 1.50 %",
        "slave: 39.1 MiB, +24 KiB a minute, 12 descriptors, 12 at the end",
        "interpreter 0.03 s (1 x)",
        "SCHED_FIFO 50, memory locked, processors awake, CPUs 2, 3",
        "kernel 6.1.0, PREEMPT_RT; frequency governor performance",
    ):
        assert said in text, said


def test_the_report_fits_80_columns() -> None:
    late = {hz: lateness(hz, late_us=123_456.0, missed=500) for hz in (1000.0, 4000.0)}
    trips = latency(1_234_567.0, 1_234_567.0)
    lines = printed(assemble(ARRANGEMENT, findings(rates=late, trips=trips)))
    assert max(map(len, lines)) <= 80
    assert not [line for line in lines if "…" in line]


def test_missed_targets_are_marked() -> None:
    missed = {hz: lateness(hz, late_us=20.0, missed=900) for hz in (1000.0, 4000.0)}
    lines = printed(assemble(ARRANGEMENT, findings(rates=missed, trips=latency(fast=False))))
    assert row(lines, "missed_share_1khz")[-1] == "MISSED"
    assert row(lines, "lateness_p99_ratio_1khz")[-1] == "met"
    assert row(lines, "one_way_p50_ratio")[-1] == "met"
    assert not [line for line in lines if "sockperf" in line]
    for name in ("missed_share_2khz", "lateness_p99_ratio_2khz"):
        (unknown,) = [one for one in targets(missed, latency()) if one.name == name]
        assert unknown.met is None


def test_the_document_is_json_and_keeps_its_units() -> None:
    document = json.loads(json.dumps(assemble(ARRANGEMENT, findings()).document, allow_nan=False))
    assert document["kind"] == "weberlink bench"
    assert [rate["rate_hz"] for rate in document["lateness"]] == [1000.0, 2000.0, 4000.0]
    daemon = document["lateness"][0]["daemons"]["slave"]
    assert daemon["lateness_us"] == {"p50": 30.0, "p90": 30.0, "p99": 30.0, "p99_9": 30.0, "max": 30.0}
    assert daemon["ratio"]["p99_9"] == pytest.approx(1.5)
    assert document["start_up"]["loopback"]["median_s"] == 1.2
    assert document["start_up"]["loopback"]["ratio_to_interpreter"] == pytest.approx(40.0)
    assert {"machine", "commit"} <= document["environment"].keys()
    assert all(key == key.lower() and " " not in key for key in document)


def rates(late_us: float, cpu_s: float, missed: int) -> dict[float, Lateness]:
    """Of 10 s; the limit has missed one deadline in 1001."""
    return {
        hz: lateness(hz, late_us=late_us, missed=missed * int(hz) // 1000, cpu_s=cpu_s, stalls=1) for hz in RATES_HZ
    }


def test_targets_judge_the_worse_side() -> None:
    slow = latency(90.0, 100.0)
    slow = replace(slow, sealed=Trips(np.full(10, 100.0), np.full(10, 100.0 / 1.3), np.full(10, 200.0)))
    found = {target.name: target for target in targets(rates(20.0, 0.8, 11), slow)}
    assert found["cpu_share_1khz"].value == pytest.approx(0.08)
    assert found["work_p50_us_1khz"].value == pytest.approx(50.0)
    for khz in ("1khz", "2khz", "4khz"):
        assert found[f"lateness_p99_ratio_{khz}"].value == pytest.approx(1.0)
        assert found[f"missed_share_{khz}"].value == pytest.approx(0.0011)
        assert found[f"missed_share_{khz}"].target == pytest.approx(1.2 / 1001)
    for name in ("p50", "p99"):
        assert found[f"one_way_{name}_ratio"].value == pytest.approx(1.3)
    assert found["one_way_p50_us"].value == pytest.approx(100.0)
    assert {name for name, target in found.items() if not target.met} == set()


def test_targets_beyond_the_bound_are_missed() -> None:
    late = rates(20.1, 0.81, 13)
    for side in late[1000.0].sides.values():
        side.records["work_us"] = 55.1
    found = targets(late, latency(131.0, 90.0))
    assert [target.name for target in found if target.met is not False] == []


def test_no_miss_is_met_where_the_limit_has_none() -> None:
    (missed,) = [one for one in targets({1000.0: lateness(1000.0)}, latency()) if one.name == "missed_share_1khz"]
    assert (missed.value, missed.target, missed.met) == (0.0, 0.0, True)


def test_exceedance_of_known_values() -> None:
    values, shares = exceedance([5.0, 2.0, 2.0, 9.0])
    assert values == pytest.approx([2.0, 5.0, 9.0], rel=0.003)
    assert shares == pytest.approx([1.0, 0.5, 0.25])


def test_the_figure_is_drawn(tmp_path: Path) -> None:
    made = findings()
    generator = np.random.default_rng(3)
    for rate in made.rates.values():
        for side in rate.sides.values():
            side.records["lateness_us"] = generator.lognormal(3.0, 0.7, side.ticks)
    bench = assemble(ARRANGEMENT, made)
    bench.draw(tmp_path / "figures")
    assert (tmp_path / "figures" / "lateness.png").read_bytes().startswith(b"\x89PNG")
