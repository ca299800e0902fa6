"""The log of a session: events, their rate limit, and lines that cannot be written."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from plugins.figures.tests.test_verdict import clean
from tests.program import ROOT, Records
from tests.records import ticks as records_of
from weberlink.protocol.paths import LinkPath
from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.record import RELEASED
from weberlink_figures.journal import Journal
from weberlink_figures.log_file import LogFile
from weberlink_figures.wording import EVENTS

RATE_HZ = 1000.0
STARTED_S, WALL_OFFSET_S = 5000.0, 1_763_000_000.0  # on the clock of the records; and from there to the wall clock
ENDED = replace(clean(), faults={"master": {"silence": 1}}, status=0)


def ticks(count: int, first: int = 0, **columns: Any) -> Records:
    """Records of a session in which nothing happens but what the columns say."""
    usual = {"state": State.ENGAGED.value, "lateness_us": 50.0, "rtt_us": np.nan}
    tick = np.arange(first, first + count)
    return records_of(count, start=STARTED_S + first / RATE_HZ, tick=tick, **usual | columns)


def since(count: int, moment: int, value: Any, before: Any = 0, until: int | None = None) -> Any:
    """A column that has another value from a tick on."""
    column = np.full(count, before)
    column[moment:until] = value
    return column


class Log:
    """A journal and its lines."""

    def __init__(self, summary_s: float = 1e9) -> None:
        self.lines: list[dict[str, Any]] = []
        self.journal = Journal(self.lines.append, RATE_HZ, now=lambda: 1_763_009_999.0, summary_s=summary_s)

    def look(self, records: Records, each: int = 100, side: str = "master") -> list[dict[str, Any]]:
        """Pass records on in pieces, as the launcher does; returns the lines."""
        before = len(self.lines)
        for start in range(0, len(records), each):
            self.journal.add(side, records[start : start + each], WALL_OFFSET_S)
        return self.lines[before:]

    def end(self) -> list[dict[str, Any]]:
        before = len(self.lines)
        self.journal.end(ENDED)
        return self.lines[before:]


CONNECTING, ENGAGED, SILENT = State.CONNECTING.value, State.ENGAGED.value, State.SILENT.value
TOLD: list[tuple[Records, list[dict[str, Any]]]] = [
    (ticks(3000), []),
    (
        ticks(2000, state=since(2000, 777, ENGAGED, CONNECTING)),
        [{"event": "engaged", "before": "connecting", "tick": 777, "at_s": 5000.777,
          "time": "2025-11-13T03:36:40.777Z"}],
    ),
    (
        ticks(5000, fault=since(5000, 1200, Fault.SILENCE, until=3450), state=since(5000, 1200, SILENT, ENGAGED, 3450)),
        [
            {"event": "silent"}, {"event": "fault", "fault": "silence", "tick": 1200},
            {"event": "engaged"}, {"event": "recovered", "fault": "silence", "tick": 3450, "lasted_s": 2.25},
        ],
    ),
    (ticks(3000, fault=Fault.REFUSED), [{"event": "fault", "fault": "refused"}]),
    (ticks(4000, settings=since(4000, 2600, 1)), [{"event": "settings", "tick": 2600, "generation": 1}]),
    (
        ticks(4000, ramping=since(4000, 1500, RELEASED, until=2600)),
        [{"event": "released", "tick": 1500}, {"event": "held", "tick": 2600}],
    ),
    (
        ticks(
            5000, ticks_missed=since(5000, 1500, 4) + since(5000, 1510, 3), clipped=since(5000, 2500, 1, until=2600),
            slew_ticks=since(5000, 3500, 3), contact_ticks=since(5000, 4500, 5),
        ),
        [{"event": name, "ticks": count} for name, count in
         (("missed", 7), ("clipped", 100), ("slewed", 3), ("pressed", 5))],
    ),
]  # fmt: skip
"""Records, and what is told of them after the line of the start."""


@pytest.mark.parametrize(("records", "expected"), TOLD)
def test_what_happens_is_told_with_its_tick(records: Records, expected: list[dict[str, Any]]) -> None:
    log = Log()
    lines = log.look(records)
    assert (lines[0]["event"], lines[0]["tick"], lines[0]["rate_hz"]) == ("started", 0, 1000.0)
    assert [line["event"] for line in lines[1:]] == [line["event"] for line in expected]
    for line, known in zip(lines[1:], expected, strict=True):
        assert known.items() <= line.items()
        assert line["side"] == "master" and line["text"] and line["level"] in ("info", "warn", "alarm")
    summary, ended = log.end()
    assert (summary["event"], ended["event"], ended["side"]) == ("summary", "ended", "session")
    assert (ended["outcome"], ended["faults"]) == ("completed", {"master": {"silence": 1}})
    assert log.end() == [] and log.look(ticks(0)) == [], "once"


def test_paths_are_told_when_new_or_changed() -> None:
    log = Log()
    first = LinkPath(remote="10.0.0.2:47000")
    second = LinkPath(0, "relayed", "relay.example", "wlan0", "198.51.100.7:3478", 1)
    for number, path in enumerate([LinkPath(), first, first, second, second]):
        log.journal.add_paths("master", [path])
        log.look(ticks(1500, first=1500 * number))
    told = log.lines
    assert [(line["event"], line["level"]) for line in told] == [
        ("started", "info"),
        ("path", "info"),
        ("path", "warn"),
    ]
    assert (told[2]["via"], told[2]["tick"]) == ("relay.example", 4499)


def test_the_summary_comes_in_time_and_counts_its_own_interval() -> None:
    count = np.arange(25_000)
    log = Log(summary_s=10.0)
    missed = 5 * (count >= 12_000)
    records = ticks(25_000, updates_sent=count // 100, datagrams_lost=count // 1000, ticks_missed=missed, rtt_us=300.0)
    lines = [line for line in log.look(records) if line["event"] == "summary"]
    assert [line["interval_s"] for line in lines] == pytest.approx([10.0, 10.0], abs=0.2)
    for line in lines:
        assert line["packets_per_s"] == pytest.approx(10.0, rel=0.02)
        assert line["reduction"] == pytest.approx(0.99, abs=0.001)
        assert line["lost"] == pytest.approx(10, abs=1)
        assert line["lateness_us"] == {"p50": 50.0, "p99": 50.0, "max": 50.0}
    assert [line["missed"] for line in lines] == [0, 5]
    (rest,) = [line for line in log.end() if line["event"] == "summary"]
    assert rest["interval_s"] == pytest.approx(5.0, abs=0.3)


def test_flapping_makes_a_line_a_second_and_the_last_word_is_how_things_are() -> None:
    flapping = (np.arange(10_000) // 10) % 2 == 1
    flapping[-500:] = False
    log = Log()
    lines = log.look(ticks(10_000, state=np.where(flapping, SILENT, ENGAGED))) + log.end()
    changes = [line for line in lines if line["event"] in ("silent", "engaged")]
    assert 9 <= len(changes) <= 12
    assert (changes[-1]["event"], changes[-1]["tick"]) == ("engaged", int(np.flatnonzero(flapping)[-1]) + 1)
    assert len(changes) + sum(line.get("suppressed", 0) for line in changes) == int(np.abs(np.diff(flapping)).sum())


# --- losing it


def test_what_cannot_be_written_is_counted_and_told_by_the_next_line() -> None:
    told: list[dict[str, Any]] = []
    failing = iter([OSError("disk full"), ValueError("closed"), False])

    def write(line: dict[str, Any]) -> bool:
        outcome = next(failing, True)
        if isinstance(outcome, Exception):
            raise outcome
        if outcome:
            told.append(line)
        return outcome

    journal = Journal(write, RATE_HZ, now=lambda: 0.0)
    records = ticks(4000)
    records["state"][1000:2500] = State.SILENT.value
    journal.add("master", records[:500], 0.0)
    journal.add("master", records[500:2000], 0.0)
    journal.add("master", records[2000:], 0.0)
    assert journal.lost_lines == 3
    journal.end(ENDED)
    assert [line.get("lost_lines") for line in told] == [3, None]


@pytest.mark.parametrize("leaves", [False, True])
def test_a_reader_that_stops_or_goes_away_costs_lines_and_no_time(tmp_path: Path, leaves: bool) -> None:
    path = tmp_path / "fifo"
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    with LogFile(path) as log:
        if leaves:
            assert log.write("here")
            os.close(reader)
            assert not log.write("gone") and log.lost == 1
            return
        written = sum(log.write("x" * 1000) for _ in range(1000))
        assert 0 < written < 1000 and log.lost == 1000 - written
        received = b""
        while len(received) < 1001 * written:
            received += os.read(reader, 1 << 20)
        assert received == (b"x" * 1000 + b"\n") * written  # no line is torn
        assert log.write("again")
    os.close(reader)


def test_a_full_disk_tears_no_line_that_comes_later(tmp_path: Path) -> None:
    """The limit on the size of a file stands for the disk: a write that meets it is cut off, then refused."""
    path = tmp_path / "log"
    script = (
        "import resource, signal, sys; from pathlib import Path; from weberlink_figures.log_file import LogFile\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "log = LogFile(Path(sys.argv[1]))\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (25, resource.RLIM_INFINITY))\n"
        "assert [log.write('x' * 9) for _ in range(4)] == [True, True, False, False]\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))\n"
        "assert log.write('after') and log.lost == 2\n"
    )
    done = subprocess.run([sys.executable, "-c", script, str(path)], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert path.read_text().splitlines() == ["x" * 9, "x" * 9, "x" * 5, "after"]


def test_every_event_of_the_log_has_its_line_on_the_page() -> None:
    page = (ROOT / "docs" / "operation" / "logs.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("|")]
    for event in EVENTS:
        assert any(f"`{event}`" in row for row in rows), event
