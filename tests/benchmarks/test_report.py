"""What a person reads: 80 columns, limits and ratios beside figures, and what was missed."""

import json
from io import StringIO

import pytest
from rich.console import Console

from benchmarks.study import Bench, assemble
from tests.benchmarks.findings import ARRANGEMENT, findings, latency, lateness


def printed(bench: Bench) -> list[str]:
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
    assert row(lines, "security") == ["5.0", "5.0"]
    assert row(lines, "sum") == ["36.0", "36.0"]
    assert row(lines, "live: CPU, share of a core") == ["5.0", "%", "10.0", "%"]
    assert row(lines, "live: CPU per tick") == ["50.0", "100"]
    text = "\n".join(lines)
    for said in (
        "200 thousand samples/s",
        "slave: 39.1 MiB, +24 KiB a minute, 12 descriptors, 12 at the end",
        "interpreter 0.03 s (1 x)",
        "SCHED_FIFO 50, memory locked, processors awake, CPUs 2, 3",
        "kernel PREEMPT_RT; governor performance",
    ):
        assert said in text, said


def test_it_fits_80_columns_and_no_number_is_cut() -> None:
    late = {hz: lateness(hz, late_us=123_456.0, missed=500) for hz in (1000.0, 4000.0)}
    way = latency(1_234_567.0, 1_234_567.0)
    lines = printed(assemble(ARRANGEMENT, findings(rates=late, way=way)))
    assert max(map(len, lines)) <= 80
    assert not [line for line in lines if "…" in line]


def test_missed_targets_are_said_aloud_and_what_is_missing_too() -> None:
    missed = {hz: lateness(hz, missed=900) for hz in (1000.0, 4000.0)}
    lines = printed(assemble(ARRANGEMENT, findings(rates=missed, way=latency(fast=False))))
    assert row(lines, "missed_share_1khz")[-1] == "MISSED"
    assert row(lines, "lateness_p99_ratio_1khz")[-1] in ("MISSED", "met")
    assert row(lines, "one_way_p50_ratio")[-1] == "met"
    assert not [line for line in lines if "sockperf" in line]


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
