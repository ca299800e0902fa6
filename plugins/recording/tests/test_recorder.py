"""The recorder as a process, beside real processes that write rings, and the deaths of each of them."""

import json
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, strategies as st
from mcap.reader import make_reader

from plugins.recording.tests.records import FACTS, SIDES
from tests import records as records_of
from tests.wait import PATIENCE, until
from weberlink.telemetry.reader import RingReader
from weberlink.telemetry.record import ALL
from weberlink.telemetry.ring import RingWriter
from weberlink_recording.marks import LONGEST_MARK
from weberlink_recording.reader import read_recording
from weberlink_recording.recorder import RecordingOrder, RingSource

ROOT = Path(__file__).parents[3]
WRITER = ROOT / "tests/telemetry/writer_process.py"


class Session:
    """Rings, their writers and a recorder, all in processes of their own."""

    def __init__(self, folder, stack):
        self.folder = folder
        self.out = folder / "session.mcap"
        self._stack = stack

    def ring(self, side):
        return self.folder / f"{side}.ring"

    def daemon(self, side, count):
        process = self._start(WRITER, self.ring(side), side, count, 10_000, 1e-3)
        assert process.stdout.readline() == b"ready\n"
        return process

    def recorder(self, sides=SIDES, **changes):
        rings = {side: str(self.ring(side)) for side in sides}
        order = RecordingOrder(**{"rings": rings, "out": str(self.out), "facts": FACTS} | changes)
        return self._start("-m", "weberlink_recording.recorder", order.to_json())

    def _start(self, *arguments):
        process = subprocess.Popen(
            [sys.executable, *map(str, arguments)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT,
        )  # fmt: skip
        self._stack.enter_context(process)
        self._stack.callback(process.kill)
        return process


@pytest.fixture
def session(tmp_path):
    with ExitStack() as stack:
        yield Session(tmp_path, stack)


def finish(process):
    """Exit status of a recorder and what it said."""
    output, _ = process.communicate(timeout=PATIENCE)
    return process.returncode, json.loads(output)


def has_written(path, size=20_000):
    return path.exists() and path.stat().st_size > size


def assert_whole(records, count=None):
    """The same, from the first record on."""
    assert records["tick"].tolist() == list(range(len(records) if count is None else count))
    records_of.assert_whole(records)


def test_every_record_of_both_sides_is_there(session):
    recorder = session.recorder()
    daemons = [session.daemon(side, 1000) for side in SIDES]
    until(lambda: has_written(session.out), "the recording to grow")
    for daemon in daemons:
        daemon.stdin.close()
    status, told = finish(recorder)
    assert (status, told["outcome"]) == (0, "complete")
    assert told["records"] == dict.fromkeys(SIDES, 1000)
    assert told["lost"] == dict.fromkeys(SIDES, 0)
    assert told["path"] == str(session.out)
    assert told["bytes"] == session.out.stat().st_size
    assert 0.0 < told["cpu_s"] < told["elapsed_s"]
    recording = read_recording(session.out)
    assert (recording.complete, recording.facts) == (True, FACTS)
    for side in SIDES:
        assert_whole(recording.records[side], 1000)
        assert recording.origins[side].rate_hz == 1000.0
    master, slave = recording.origins.values()
    assert (master.wall_s, master.monotonic_s) == (slave.wall_s, slave.monotonic_s)
    with session.out.open("rb") as file:
        times = [message.log_time for *_, message in make_reader(file, validate_crcs=True).iter_messages()]
    now = time.time()
    assert now - 60.0 < min(times) / 1e9 < max(times) / 1e9 < now


def command(recorder, **content):
    recorder.stdin.write(json.dumps(content).encode() + b"\n")
    recorder.stdin.flush()


def test_begins_during_a_session_and_takes_marks(session):
    daemons = [session.daemon(side, 0) for side in SIDES]
    time.sleep(0.3)
    marked = time.monotonic()
    recorder = session.recorder(since=marked)
    command(recorder, mark="  before \n the file ", at=marked)
    until(lambda: has_written(session.out), "the recording to grow")
    recorder.stdin.write(b"no command\n[]\n")
    command(recorder, mark="x" * 300, at=time.monotonic())
    command(recorder, finish=True)
    status, told = finish(recorder)
    assert all(daemon.poll() is None for daemon in daemons)
    assert (status, told["outcome"], told["marks"]) == (0, "complete", 2)
    assert told["lost"] == dict.fromkeys(SIDES, 0)
    recording = read_recording(session.out)
    assert recording.complete
    assert [mark.text for mark in recording.marks] == ["before the file", "x" * LONGEST_MARK]
    origin = recording.origins["master"]
    at = recording.marks[0].wall_ns / 1e9 - origin.wall_s + origin.monotonic_s
    assert abs(at - marked) < 1e-4
    for side in SIDES:
        records = recording.records[side]
        assert marked <= records["at"][0] < marked + 2e-3 and (np.diff(records["tick"]) == 1).all()


def test_a_killed_recorder_leaves_what_it_had_written(session):
    daemons = [session.daemon(side, 0) for side in SIDES]
    recorder = session.recorder()
    until(lambda: has_written(session.out), "the recording to grow")
    before, size = read_recording(session.out), session.out.stat().st_size
    until(lambda: has_written(session.out, size), "the next look of the recorder")
    recorder.kill()
    recorder.wait()
    assert all(daemon.poll() is None for daemon in daemons)
    recording = read_recording(session.out)
    assert (recording.complete, recording.outcome) == (False, "cut off")
    for side in SIDES:
        assert_whole(recording.records[side])
    assert all(len(recording.records[side]) >= len(records) for side, records in before.records.items())


@pytest.mark.parametrize("is_listening", [True, False])
def test_a_killed_daemon_costs_none_of_its_records(session, is_listening):
    """A side that never began does not hold the recorder up, nor does it need anybody who listens."""
    daemon = session.daemon("slave", 0)
    recorder = session.recorder()
    if not is_listening:
        recorder.stdout.close()
    with closing(RingReader(session.ring("slave"))) as ring:
        until(lambda: has_written(session.out), "the recording to grow")
        daemon.kill()
        daemon.wait()
        if is_listening:
            assert (finish(recorder)[1]["outcome"], recorder.returncode) == ("complete", 0)
        else:
            assert recorder.wait(PATIENCE) == 0
        recording = read_recording(session.out)
        assert recording.complete and tuple(recording.records) == ("slave",)
        assert_whole(recording.records["slave"], ring.written)


def test_it_outlives_whoever_started_it(session):
    daemon = session.daemon("slave", 0)
    order = RecordingOrder({"slave": str(session.ring("slave"))}, str(session.out), FACTS)
    parent = subprocess.Popen(
        [sys.executable, "-c", "import subprocess, sys, time\n"
         "process = subprocess.Popen([sys.executable, '-m', 'weberlink_recording.recorder', sys.argv[1]],"
         " stdout=subprocess.PIPE, start_new_session=True)\n"
         "print(process.pid, flush=True)\n"
         "time.sleep(100)", order.to_json()],
        stdout=subprocess.PIPE, cwd=ROOT,
    )  # fmt: skip
    with parent:
        pid = int(parent.stdout.readline())
        until(lambda: has_written(session.out), "the recording to grow")
        parent.kill()
    before = session.out.stat().st_size
    until(lambda: has_written(session.out, before), "the recording to grow further")
    with closing(RingReader(session.ring("slave"))) as ring:
        daemon.kill()
        daemon.wait()
        until(lambda: ended(pid), "the recorder to end")
        recording = read_recording(session.out)
        assert recording.complete
        assert_whole(recording.records["slave"], ring.written)


def ended(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_bytes().rpartition(b")")[2].split()[0] in (b"Z", b"X")
    except (FileNotFoundError, ProcessLookupError):
        return True


def test_told_to_stop_it_takes_what_is_there_and_finishes(session):
    session.daemon("slave", 0)
    recorder = session.recorder(["slave"])
    until(lambda: has_written(session.out), "the recording to grow")
    with closing(RingReader(session.ring("slave"))) as ring:
        written = ring.written
    recorder.send_signal(signal.SIGHUP)  # of a terminal that closes: ignored
    recorder.send_signal(signal.SIGTERM)
    status, told = finish(recorder)
    assert (status, told["outcome"]) == (1, "stopped by SIGTERM")
    recording = read_recording(session.out)
    assert (recording.complete, recording.outcome) == (False, told["outcome"])
    assert len(recording.records["slave"]) >= written
    assert_whole(recording.records["slave"], told["records"]["slave"])


class Kept:
    """A writer that only counts."""

    def __init__(self):
        self.ticks, self.lost = [], 0

    def note_lost(self, side, count):
        self.lost += count

    def write(self, side, records):
        self.ticks += records["tick"].tolist()


@given(st.integers(2, 9), st.integers(0, 25), st.lists(st.integers(0, 25), max_size=8))
@example(4, 20, [0, 10, 0, 0])
def test_records_that_were_overwritten_are_counted_once(capacity, before, steps):
    """Those before the recorder came too, which the ring itself does not tell."""
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "ring")
        with RingWriter(Path(path), side="master", rate_hz=1000.0, capacity=capacity) as ring:
            source, kept, total = RingSource("master", path), Kept(), 0
            for step in (before, *steps):
                for tick in range(total, total + step):
                    ring.write((tick % 256,) * len(ALL.format))
                total += step
                assert source.open()
                source.move(kept)
            source.close()
        assert kept.ticks == sorted(set(kept.ticks))
        assert kept.lost + len(kept.ticks) == total
