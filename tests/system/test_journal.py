"""The log of a session: events, their rate limit, and lines that cannot be written."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.program import Program, document
from tests.wait import until
from weberlink.protocol.aio.hand_over import PathFacts
from weberlink.protocol.states import State
from weberlink.system.configuration import ConfigurationError
from weberlink.system.journal import Journal
from weberlink.system.log_file import LONGEST_LINE, LogFile
from weberlink.system.paths import paths_of
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.record import RELEASED

RATE_HZ = 1000.0
STARTED_S, WALL_OFFSET_S = 5000.0, 1_763_000_000.0
"""On the clock of the records; and from there to the wall clock."""
SUMMARY = {"outcome": "completed", "duration_s": 2.0, "faults": {"master": {"silence": 1}}, "ticks": {}, "status": 0}


def ticks(count: int, first: int = 0) -> NDArray[Any]:
    """Records of a session in which nothing happens."""
    records = np.zeros(count, DTYPE)
    records["tick"] = np.arange(first, first + count)
    records["at"] = STARTED_S + records["tick"] / RATE_HZ
    records["state"] = State.ENGAGED.value
    records["lateness_us"] = 50.0
    records["rtt_us"] = np.nan
    return records


class Log:
    """A journal and its lines."""

    def __init__(self, summary_s: float = 1e9) -> None:
        self.lines: list[str] = []
        self.journal = Journal(self.lines.append, RATE_HZ, now=lambda: 1_763_009_999.0, summary_s=summary_s)

    def look(self, records: NDArray[Any], each: int = 100, side: str = "master") -> list[dict[str, Any]]:
        """Pass records on in pieces, as the launcher does; returns the lines."""
        before = len(self.lines)
        for start in range(0, len(records), each):
            self.journal.look(side, records[start : start + each], WALL_OFFSET_S)
        return [json.loads(line) for line in self.lines[before:]]

    def end(self, summary: dict[str, Any] | None = None) -> list[dict[str, Any]]:
        before = len(self.lines)
        self.journal.end(SUMMARY if summary is None else summary)
        return [json.loads(line) for line in self.lines[before:]]


def names(lines: list[dict[str, Any]]) -> list[str]:
    return [line["event"] for line in lines]


# --- what is told


def test_paths_are_told_when_new_or_changed() -> None:
    log = Log()
    waiting, first = PathFacts(), PathFacts(remote="10.0.0.2:47000")
    second = PathFacts(0, "relayed", "relay.example", "wlan0", "198.51.100.7:3478", 1)
    for number, path in enumerate([waiting, first, first, second, second]):
        log.journal.take_paths("master", paths_of({"paths": [path._asdict()]}))
        log.look(ticks(1500, first=1500 * number))
    told = [json.loads(line) for line in log.lines]
    assert names(told) == ["started", "path", "path"]
    assert [(line["level"], line["text"]) for line in told[1:]] == [
        ("info", "path: direct"),
        ("warn", "path: relayed by relay.example over wlan0, 1 change"),
    ]
    assert told[2].items() >= {key: fact for key, fact in second._asdict().items() if fact is not None}.items()
    assert told[2]["tick"] == 4499


def test_a_flapping_path_makes_one_line_a_second() -> None:
    log = Log()
    log.look(ticks(10))
    for number in range(1, 300):
        path = PathFacts(remote="10.0.0.2:47000", changes=number)
        log.journal.take_paths("master", paths_of({"paths": [path._asdict()]}))
        log.look(ticks(10, first=10 * number))
    log.look(ticks(1500, first=3000))
    lines = [line for line in map(json.loads, log.lines) if line["event"] == "path"]
    assert len(lines) <= 5
    assert lines[-1]["changes"] == 299, "the last change is told"
    assert sum(line.get("suppressed", 0) for line in lines) + len(lines) == 299


def test_a_session_in_which_nothing_happens_has_a_beginning_figures_and_an_end() -> None:
    log = Log()
    lines = log.look(ticks(3000)) + log.end()
    assert names(lines) == ["started", "summary", "ended"]
    assert lines[0] == {
        "time": "2025-11-13T03:36:40.000Z", "side": "master", "event": "started", "tick": 0, "at_s": 5000.0,
        "state": "engaged", "rate_hz": 1000.0, "level": "info",
        "text": "began at 1000 Hz; engaged: in a session with the slave",
    }  # fmt: skip
    assert (lines[-1]["side"], lines[-1]["outcome"]) == ("session", "completed")
    assert lines[-1]["faults"] == {"master": {"silence": 1}}


def test_a_change_is_told_with_its_very_tick_and_time() -> None:
    records = ticks(2000)
    records["state"][:777] = State.CONNECTING.value
    started, engaged = Log().look(records)
    assert (started["event"], started["state"]) == ("started", "connecting")
    assert (engaged["event"], engaged["before"], engaged["tick"], engaged["at_s"]) == (
        "engaged", "connecting", 777, 5000.777,
    )  # fmt: skip
    assert datetime.fromisoformat(engaged["time"]).timestamp() == pytest.approx(WALL_OFFSET_S + 5000.777, abs=1e-3)


def test_a_fault_begins_and_ends_by_name_and_says_how_long_it_took() -> None:
    records = ticks(5000)
    records["fault"][1200:3450] = Fault.SILENCE
    records["state"][1200:3450] = State.SILENT.value
    lines = Log().look(records)
    assert names(lines) == ["started", "silent", "fault", "engaged", "recovered"]
    assert (lines[2]["fault"], lines[2]["tick"]) == ("silence", 1200)
    assert (lines[4]["fault"], lines[4]["tick"], lines[4]["lasted_s"]) == ("silence", 3450, 2.25)


def test_one_fault_after_the_other_ends_the_first() -> None:
    records = ticks(6000)
    records["fault"][1000:3000] = Fault.SILENCE
    records["fault"][3000:] = Fault.DEVICE
    log = Log()
    lines = log.look(records)
    told = [(line["event"], line["fault"]) for line in lines[1:]]
    assert told == [("fault", "silence"), ("recovered", "silence"), ("fault", "device")]


def test_a_session_that_begins_with_a_fault_says_so() -> None:
    records = ticks(3000)
    records["fault"] = Fault.REFUSED
    assert [line.get("fault") for line in Log().look(records)] == [None, "refused"]


def test_live_changes_are_told() -> None:
    records = ticks(4000)
    records["settings"][2600:] = 1
    (line,) = Log().look(records)[1:]
    assert (line["event"], line["tick"], line["generation"]) == ("settings", 2600, 1)


def test_button_of_the_operator_is_told() -> None:
    records = ticks(4000)
    records["ramping"][1500:2600] = RELEASED
    lines = Log().look(records)
    assert [(line["event"], line["tick"]) for line in lines[1:]] == [("released", 1500), ("held", 2600)]


def test_missed_ticks_and_outputs_at_a_limit_are_counted() -> None:
    records = ticks(5000)
    records["ticks_missed"][1500:] = 4
    records["ticks_missed"][1510:] = 7
    records["clipped"][2500:2600] = 1
    records["slew_ticks"][3500:] = 3
    records["contact_ticks"][4500:] = 5
    lines = Log().look(records)
    counted = [(line["event"], line["ticks"]) for line in lines[1:]]
    assert counted == [("missed", 7), ("clipped", 100), ("slewed", 3), ("pressed", 5)]


def test_sides_are_told_apart() -> None:
    log = Log()
    silent = ticks(2000)
    silent["state"][1000:] = State.SILENT.value
    log.look(ticks(2000), side="master")
    lines = log.look(silent, side="slave")
    assert [(line["side"], line["event"]) for line in lines] == [("slave", "started"), ("slave", "silent")]


# --- figures


def test_the_summary_comes_in_time_and_counts_its_own_interval() -> None:
    records = ticks(25_000)
    records["updates_sent"] = np.arange(25_000) // 100
    records["datagrams_lost"] = np.arange(25_000) // 1000
    records["ticks_missed"][12_000:] = 5
    records["rtt_us"] = 300.0
    log = Log(summary_s=10.0)
    lines = [line for line in log.look(records) if line["event"] == "summary"]
    assert [line["interval_s"] for line in lines] == pytest.approx([10.0, 10.0], abs=0.2)
    for line in lines:
        assert line["packets_per_s"] == pytest.approx(10.0, rel=0.02)
        assert line["reduction"] == pytest.approx(0.99, abs=0.001)
        assert line["lost"] == pytest.approx(10, abs=1)
        assert line["lateness_us"] == {"p50": 50.0, "p99": 50.0, "max": 50.0}
        assert line["rtt_us"]["p50"] == pytest.approx(300.0, rel=0.01)
    assert [line["missed"] for line in lines] == [0, 5]
    (rest,) = [line for line in log.end() if line["event"] == "summary"]
    assert rest["interval_s"] == pytest.approx(5.0, abs=0.3)


def test_what_is_not_known_is_null() -> None:
    log = Log()
    idle = ticks(10)
    idle["state"] = State.LISTENING.value
    log.look(idle)
    summary = log.end()[0]
    assert (summary["rtt_us"], summary["reduction"]) == ({"p50": None, "p99": None}, None)


# --- how much of it


def test_flapping_makes_a_line_a_second_and_the_last_word_is_how_things_are() -> None:
    records = ticks(10_000)
    flapping = (np.arange(10_000) // 10) % 2 == 1
    flapping[-500:] = False
    records["state"][flapping] = State.SILENT.value
    log = Log()
    lines = log.look(records) + log.end()
    changes = [line for line in lines if line["event"] in ("silent", "engaged")]
    assert 9 <= len(changes) <= 12
    assert changes[-1]["event"] == "engaged"
    assert changes[-1]["tick"] == int(np.flatnonzero(flapping)[-1]) + 1
    assert len(changes) + sum(line.get("suppressed", 0) for line in changes) == int(np.abs(np.diff(flapping)).sum())


def test_bursts_of_missed_ticks_make_a_line_a_second_and_none_is_forgotten() -> None:
    records = ticks(10_000)
    records["ticks_missed"] = np.arange(10_000) // 3
    log = Log()
    lines = [line for line in log.look(records) + log.end() if line["event"] == "missed"]
    assert 9 <= len(lines) <= 12
    assert sum(line["ticks"] for line in lines) == int(records["ticks_missed"][-1])


ROWS = st.tuples(st.integers(0, 7), st.integers(0, 6), st.integers(0, 255), st.booleans())


@given(st.lists(ROWS, min_size=1, max_size=40), st.integers(1, 50))
def test_whatever_the_records_hold_output_is_bounded_and_json(
    rows: list[tuple[int, int, int, bool]], each: int
) -> None:
    records = ticks(len(rows))
    for name, column in zip(("state", "fault", "settings", "clipped"), zip(*rows, strict=True), strict=True):
        records[name] = column
    records["ticks_missed"] = np.cumsum(records["clipped"])
    log = Log()
    lines = log.look(records, each) + log.end()
    # Less than a second: two lines of a kind at most, of which the second waits for the end.
    assert len(lines) <= 3 + 2 * 5
    assert all(len(json.dumps(line)) < LONGEST_LINE for line in lines)


def test_looks_without_records_and_a_second_end_tell_nothing() -> None:
    log = Log()
    assert log.look(ticks(0)) == []
    log.journal.look("master", ticks(0), WALL_OFFSET_S)
    assert names(log.end()) == ["ended"]
    assert log.end() == []


# --- losing it


def test_what_cannot_be_written_is_counted_and_told_by_the_next_line() -> None:
    told: list[str] = []
    failing = iter([OSError("disk full"), ValueError("closed"), False])

    def write(line: str) -> bool:
        outcome = next(failing, True)
        if isinstance(outcome, Exception):
            raise outcome
        if outcome:
            told.append(line)
        return outcome

    journal = Journal(write, RATE_HZ, now=lambda: 0.0)
    records = ticks(4000)
    records["state"][1000:2500] = State.SILENT.value
    journal.look("master", records[:500], 0.0)
    journal.look("master", records[500:2000], 0.0)
    journal.look("master", records[2000:], 0.0)
    assert journal.lost_lines == 3
    journal.end(SUMMARY)
    assert [json.loads(line).get("lost_lines") for line in told] == [3, None]


def test_a_file_is_added_to(tmp_path: Path) -> None:
    path = tmp_path / "session.jsonl"
    for text in ("one", "two"):
        with LogFile(path) as log:
            assert log.write(text)
    assert path.read_text() == "one\ntwo\n"


@pytest.mark.parametrize("name", ["missing/log", "."])
def test_a_file_that_cannot_be_opened_is_one_line(tmp_path: Path, name: str) -> None:
    with pytest.raises(ConfigurationError, match="--log: "):
        LogFile(tmp_path / name)


@contextmanager
def pipe(tmp_path: Path) -> Iterator[tuple[int, Path]]:
    """The reading end of a FIFO, and its path."""
    path = tmp_path / "fifo"
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        yield reader, path
    finally:
        os.close(reader)


def test_a_reader_that_stops_reading_costs_lines_and_no_time(tmp_path: Path) -> None:
    with pipe(tmp_path) as (reader, path), LogFile(path) as log:
        written = sum(log.write("x" * 1000) for _ in range(1000))
        assert 0 < written < 1000
        assert log.lost == 1000 - written
        received = b""
        while True:
            try:
                received += os.read(reader, 1 << 20)
            except BlockingIOError:
                break
        assert received == (b"x" * 1000 + b"\n") * written  # no line is torn
        assert log.write("again")


def test_a_reader_that_goes_away_costs_lines_and_no_more(tmp_path: Path) -> None:
    path = tmp_path / "fifo"
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    with LogFile(path) as log:
        assert log.write("here")
        os.close(reader)
        assert not log.write("gone")
        assert log.lost == 1


def test_a_line_that_is_too_long_is_not_written(tmp_path: Path) -> None:
    with LogFile(tmp_path / "log") as log:
        assert not log.write("x" * LONGEST_LINE)
        assert log.write("x" * (LONGEST_LINE - 1))


def test_a_full_disk_tears_no_line_that_comes_later(tmp_path: Path) -> None:
    """The limit on the size of a file stands for the disk: a write that meets it is cut off, then refused."""
    path = tmp_path / "log"
    script = (
        "import resource, signal, sys; from pathlib import Path; from weberlink.system.log_file import LogFile\n"
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


def test_standard_output_that_nobody_reads_any_more_does_not_hurt() -> None:
    script = (
        "import sys; from pathlib import Path; from weberlink.system.log_file import LogFile\n"
        "with LogFile(Path('-')) as log:\n"
        "    print('ready', file=sys.stderr, flush=True); sys.stdin.read()\n"
        "    log.write('line')\n"
        "sys.exit(log.lost)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    with process:
        assert process.stderr is not None
        assert process.stdout is not None
        assert process.stdin is not None
        assert process.stderr.readline() == "ready\n"
        process.stdout.close()
        process.stdin.close()
        until(lambda: process.poll() is not None, "the end of the process")
        assert (process.returncode, process.stderr.read()) == (1, "")


def test_standard_output_whose_reader_has_stopped_holds_up_nothing() -> None:
    """A pipe that waits, as that of a shell does: it is full after 64 kB."""
    script = (
        "import sys; from pathlib import Path; from weberlink.system.log_file import LogFile\n"
        "with LogFile(Path('-')) as log:\n"
        "    written = sum(log.write('x' * 1000) for _ in range(1000))\n"
        "sys.exit(not 0 < written < 1000)\n"
    )
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE) as process:
        try:
            until(lambda: process.poll() is not None, "the end of the process")
        finally:
            process.kill()
        assert process.returncode == 0


# --- a real session


@pytest.mark.realtime
def test_log_of_a_session_agrees_with_its_report(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    with Program("loopback", "--duration", 0.5, "--log", "-", "--json", path) as session:
        status, output, errors = session.finish()
    assert (status, errors) == (0, "")
    lines = [json.loads(line) for line in output.splitlines()]  # nothing else is on standard output
    for event in ("started", "summary"):
        assert {line["side"] for line in lines if line["event"] == event} == {"master", "slave"}
    report, ended = document(path.read_text(encoding="utf-8")), lines[-1]
    assert (ended["event"], ended["outcome"]) == ("ended", report["outcome"])
    assert ended["force"]["packets_per_s"] == report["force"]["packets_per_s"]


def test_a_log_that_cannot_be_opened_is_one_line_and_status_2(tmp_path: Path) -> None:
    with Program("loopback", "--duration", 1, "--log", tmp_path / "missing" / "log") as session:
        status, output, errors = session.finish()
    assert (status, output) == (2, "")
    assert len(errors.splitlines()) == 1
    assert "--log: " in errors
