"""The ring file, its writer and its readers: completeness, overrun, torn records, and the death of either end."""

import os
import resource
import stat
import struct
import tempfile
import time
from contextlib import closing
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, strategies as st

from tests.records import assert_whole
from weberlink.telemetry.reader import DTYPE, RingReader
from weberlink.telemetry.record import FIELDS, MOST_AXES, RECORD, SECOND, layout
from weberlink.telemetry.ring import (
    RECORDS_AT,
    RingFormatError,
    RingInUseError,
    RingWriter,
    is_alive,
    process_started,
    read_header,
    slot_bytes,
)
from weberlink.telemetry.row import Row


def create(path, **changes):
    return RingWriter(path, **({"side": "master", "rate_hz": 1000.0, "capacity": 8} | changes))


def header_of(path):
    with path.open("rb") as file:
        return read_header(path, file.fileno())


@pytest.fixture
def path(tmp_path):
    return tmp_path / "test.ring"


def test_the_header_says_who_writes_and_since_when(path):
    before = time.time(), time.monotonic()
    with create(path, side="slave ü", rate_hz=4000.0, capacity=16):
        header = header_of(path)
    assert header.side.rstrip(b"\0").decode() == "slave ü"
    assert (header.rate_hz, header.capacity, header.pid, header.record_size) == (4000.0, 16, os.getpid(), RECORD.size)
    assert before[0] <= header.started_wall_s <= time.time()
    assert before[1] <= header.started_monotonic_s <= time.monotonic()


def test_the_file_has_all_its_memory_and_belongs_to_this_user(path):
    with create(path, capacity=1000):
        status = path.stat()
    assert status.st_size == RECORDS_AT + 1000 * slot_bytes()
    assert status.st_blocks * 512 >= status.st_size
    assert stat.S_IMODE(status.st_mode) == 0o600


def test_a_living_writer_is_not_replaced_not_even_by_its_own_process(path, start):
    process = start("writer_process.py", path, "master", 0, 8, 0.01)
    with pytest.raises(RingInUseError, match=f"process {process.pid} is writing it"):
        create(path)
    with create(path.with_name("own")), pytest.raises(RingInUseError, match=f"process {os.getpid()}"):
        create(path.with_name("own"))


def test_the_file_of_a_killed_writer_is_replaced(path, start):
    process = start("writer_process.py", path, "master", 0, 8, 0.01)
    process.kill()
    # Not reaped yet: what is left of it still has a process id, and counts as dead.
    os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
    with create(path):
        assert header_of(path).pid == os.getpid()
    # So is a finished one of a living process.
    create(path.with_name("own"), side="first").close(unlink=False)
    with create(path.with_name("own"), side="second"):
        assert header_of(path.with_name("own")).side.rstrip(b"\0") == b"second"


@pytest.mark.parametrize("content", [b"", b"notes of a user", b"\0" * 4096])
def test_a_file_that_is_no_ring_is_left_alone(path, content):
    path.write_bytes(content)
    with pytest.raises(RingFormatError, match="not a telemetry ring"):
        create(path)
    assert path.read_bytes() == content


def test_without_room_there_is_an_error_at_the_start_and_nothing_is_left(path):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, limits[1]))
    try:
        with pytest.raises(OSError, match="too large"):
            create(path, capacity=1000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert list(path.parent.iterdir()) == []


def test_a_record_that_does_not_fit_is_not_published(path):
    with create(path) as writer, closing(RingReader(path)) as reader:
        writer.write(record(1))
        with pytest.raises(struct.error):
            writer.write((1.0,))
        with pytest.raises(struct.error):
            writer.write((-1,) * len(record(0)))
        writer.write(record(2))
        assert reader.read()["tick"].tolist() == [1, 2]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"side": ""}, "side must be 1 to 32 bytes"),
        ({"side": "x" * 33}, "side must be 1 to 32 bytes"),
        ({"rate_hz": 0.0}, "rate_hz must be positive"),
        ({"rate_hz": float("nan")}, "rate_hz must be positive"),
        ({"capacity": 1}, "capacity must be 2 to"),
    ],
)
def test_arguments_out_of_range_are_named(path, changes, message):
    with pytest.raises(ValueError, match=message):
        create(path, **changes)
    assert not path.exists()


def test_a_process_is_known_by_its_start_and_not_by_its_number_alone(path):
    assert process_started(os.getpid()) == process_started(os.getpid())
    assert process_started(2**22 + 1) is None
    with create(path):
        header = header_of(path)
    assert is_alive(header)
    assert not is_alive(header._replace(pid_started=header.pid_started + 1))


def record(i):
    return tuple(i % 256 if field.kind == "u1" else i for field in FIELDS for _ in range(field.axes))


@given(capacity=st.integers(2, 9), before=st.integers(0, 25), steps=st.lists(st.integers(0, 25), max_size=12))
def test_a_reader_gets_the_newest_records_without_a_gap_and_counts_the_rest(capacity, before, steps):
    with tempfile.TemporaryDirectory() as directory, create(Path(directory) / "ring", capacity=capacity) as writer:
        for i in range(before):
            writer.write(record(i))
        with closing(RingReader(writer.path)) as reader:
            total, first, read = before, max(0, before - capacity + 1), 0
            for step in [0, *steps]:
                for i in range(total, total + step):
                    writer.write(record(i))
                total += step
                ticks = reader.read()["tick"].tolist()
                assert (reader.read().shape, reader.read().dtype) == ((0,), DTYPE)
                assert ticks == list(range(total - len(ticks), total))
                read += len(ticks)
                assert first + read + reader.overrun == total
                assert len(ticks) == min(step, capacity - 1) or step == 0


def test_axes_and_streams_that_a_session_lacks_read_as_zero(path):
    row = Row()
    for field in FIELDS:
        setattr(row, field.name, 1 if field.axes == 1 else (1.0,) * 3)
    kept = layout(3, 1)
    with RingWriter(path, side="slave", rate_hz=4000.0, capacity=8, records=kept) as writer:
        writer.write(kept.values(row))
        with closing(RingReader(path)) as reader:
            (record,) = reader.read()
    for field in FIELDS:
        expected = [1.0] * 3 + [0.0] * 6 if field.axes == MOST_AXES else not field.name.startswith(SECOND)
        assert np.all(record[field.name] == expected)


def test_another_process_is_followed_while_it_writes_without_a_torn_record(path, start):
    # So small a ring is lapped in microseconds: most copies are overwritten while they are made.
    start("writer_process.py", path, "master", 0, 4, 0)
    with closing(RingReader(path)) as reader:
        first, last, got = None, -1, 0
        for _ in range(20_000):
            records = reader.read()
            if len(records):
                assert_whole(records)
                ticks = records["tick"].astype(np.int64)
                assert ticks[0] > last
                assert np.all(np.diff(ticks) == 1)
                first = int(ticks[0]) if first is None else first
                last, got = int(ticks[-1]), got + len(ticks)
        assert reader.alive
        assert got > 0
        assert reader.overrun > 0


@given(
    capacity=st.integers(2, 9),
    written=st.integers(1, 25),
    late=st.lists(st.tuples(st.integers(0, 10**6), st.integers(1, 700)), min_size=1, max_size=4),
)
@example(capacity=8, written=3, late=[(0, 10**6)])
def test_a_record_is_read_when_all_of_it_is_visible_and_not_when_its_counter_is(capacity, written, late):
    """A processor that reorders stores shows the counter first: some bytes of the slot are still those before it."""
    with tempfile.TemporaryDirectory() as directory, create(Path(directory) / "ring", capacity=capacity) as writer:
        for i in range(written - 1):
            writer.write(record(i))
        before = writer.path.read_bytes()
        with closing(RingReader(writer.path)) as reader, writer.path.open("r+b") as file:
            got = reader.read()["tick"].tolist()
            writer.write(record(written - 1))
            after = writer.path.read_bytes()
            size = (len(after) - RECORDS_AT) // capacity
            slot = RECORDS_AT + (written - 1) % capacity * size
            seen = bytearray(after)
            for start, length in late:
                hidden = slice(slot + start % size, min(slot + start % size + length, slot + size))
                seen[hidden] = before[hidden]
            file.write(seen)
            file.flush()
            torn = reader.read()
            assert len(torn) == (seen == after)
            file.seek(0)
            file.write(after)
            file.flush()
            last = reader.read()
            assert len(torn) + len(last) == 1
            for each, field in product(np.concatenate([torn, last]), FIELDS):
                assert np.all(each[field.name] == ((written - 1) % 256 if field.kind == "u1" else written - 1))
            assert got == list(range(max(0, written - capacity), written - 1))
            assert reader.overrun == 0


def test_a_killed_writer_leaves_all_that_it_published(path, start):
    process = start("writer_process.py", path, "master", 0, 50, 0)
    with closing(RingReader(path)) as reader:
        while reader.written < 1000:
            pass
        assert reader.alive
        process.kill()
        process.wait()
        assert not reader.alive
        reader.read()
    with closing(RingReader(path)) as late:
        records = late.read()
        assert len(records) == 49
        assert records["tick"].tolist() == list(range(late.written - 49, late.written))
        assert_whole(records)


@pytest.mark.parametrize(
    ("offset", "value", "message"),
    [
        (8, 99, "layout version 99, this program reads version 4"),
        (12, 0, "other fields than those of this program"),
        (16, 8, "other fields than those of this program"),
        (32, 1, "too few for 1 records"),
        (32, 1_000_000, "too few for 1000000 records"),
        (32, 2**32 - 1, "too few for 4294967295 records"),
    ],
)
def test_a_ring_that_cannot_be_read_says_why(path, offset, value, message):
    create(path).close(unlink=False)
    data = bytearray(path.read_bytes())
    struct.pack_into("<I", data, offset, value)
    path.write_bytes(data)
    with pytest.raises(RingFormatError, match=message) as error:
        RingReader(path)
    assert str(path) in str(error.value)
