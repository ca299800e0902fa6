"""The target of a remote leader in shared memory: what is read, who may write, and what is left of a dead writer."""

import os
import signal
from collections.abc import Iterator
from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.strangers import as_stranger, needs_root, read_file
from weberlink.master.devices.remote_link import (
    SIZE,
    LeaderTarget,
    TargetInUseError,
    TargetMemory,
    TargetWriter,
    target_path,
)
from weberlink.telemetry.runtime_directory import ForeignFileError

ANGLE = st.floats(allow_nan=False, allow_infinity=False)
HERE = (0.1, -0.2, 0.3)


@pytest.fixture
def memory() -> Iterator[TargetMemory]:
    made = TargetMemory()
    made.open(3)
    yield made
    made.close()


def test_target_is_read_once(memory: TargetMemory) -> None:
    assert memory.newest() is None
    with TargetWriter(os.getpid()) as writer:
        writer.write((9.0, 9.0, 9.0))
        writer.write(HERE)
        assert memory.newest() == LeaderTarget(HERE, True)
        assert memory.newest() is None
    assert memory.newest() == LeaderTarget(HERE, False), "who leaves lets go"


@examples(30)
@given(st.lists(ANGLE, min_size=1, max_size=9).map(tuple))
def test_any_finite_angles_arrive_exactly(angles: tuple[float, ...]) -> None:
    memory = TargetMemory()
    memory.open(len(angles))
    with TargetWriter(os.getpid()) as writer:
        writer.write(angles)
        newest = memory.newest()
    memory.close()
    assert newest is not None
    assert newest.angles == angles


@pytest.mark.parametrize("angles", [(0.0, nan, 0.0), (inf, 0.0, 0.0), (0.0, 0.0), (0.0,) * 4])
def test_target_that_cannot_be_meant_is_refused(memory: TargetMemory, angles: tuple[float, ...]) -> None:
    with TargetWriter(os.getpid()) as writer, pytest.raises(ValueError, match="expected 3 finite angles"):
        writer.write(angles)
    assert memory.newest() is None


def test_one_program_leads_at_a_time(memory: TargetMemory) -> None:
    first = TargetWriter(os.getpid())
    with pytest.raises(TargetInUseError, match="another process leads this arm already"):
        TargetWriter(os.getpid())
    first.write(HERE)
    first.close()
    first.close()
    with TargetWriter(os.getpid()) as second:
        second.write(HERE)
        newest = memory.newest()
    assert newest == LeaderTarget(HERE, True)


def test_killed_writer_leaves_the_lead_to_another(memory: TargetMemory) -> None:
    reading, writing = os.pipe()
    pid = os.fork()
    if pid == 0:
        writer = TargetWriter(os.getppid())
        writer.write(HERE)
        os.write(writing, b"x")
        signal.pause()
    assert os.read(reading, 1) == b"x"
    with pytest.raises(TargetInUseError):
        TargetWriter(os.getpid())
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    os.close(reading)
    os.close(writing)
    with TargetWriter(os.getpid()) as writer:
        writer.write((1.0, 1.0, 1.0))
        newest = memory.newest()
    assert newest is not None
    assert newest.angles == (1.0, 1.0, 1.0)


def test_file_is_private_and_goes_with_the_daemon(memory: TargetMemory) -> None:
    path = target_path(os.getpid())
    assert path.stat().st_mode & 0o777 == 0o600
    memory.close()
    assert not path.exists()
    with pytest.raises(FileNotFoundError):
        TargetWriter(os.getpid())
    assert memory.newest() is None


def test_other_file_in_its_place_is_refused(memory: TargetMemory) -> None:
    path = target_path(os.getpid())
    path.write_bytes(bytes(SIZE))
    with pytest.raises(ForeignFileError, match="not the target of a remote leader"):
        TargetWriter(os.getpid())


@needs_root
def test_other_user_cannot_read_it(memory: TargetMemory) -> None:
    assert as_stranger(read_file, str(target_path(os.getpid()))) == "refused"
