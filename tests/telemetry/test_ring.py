"""The ring file and its writer."""

import os
import resource
import stat
import struct
import time

import pytest

from weberlink.telemetry.reader import RingReader
from weberlink.telemetry.record import COLUMNS, RECORD
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


def record(i):
    return (i % 256,) * len(COLUMNS)


def create(path, **changes):
    return RingWriter.create(path, **({"side": "master", "rate_hz": 1000.0, "capacity": 8} | changes))


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
    with create(path) as writer, RingReader(path) as reader:
        writer.write(record(1))
        with pytest.raises(struct.error):
            writer.write((1.0,))
        with pytest.raises(struct.error):
            writer.write((-1,) * len(COLUMNS))
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
