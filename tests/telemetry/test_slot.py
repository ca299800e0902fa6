"""A slot between two processes, and poses in one: newest whole values, and nothing else."""

import os
from mmap import mmap
from pathlib import Path
from struct import Struct, error

import numpy as np
import pytest

from tests.wait import until
from weberlink.slot import Slot, size_of
from weberlink.telemetry.pose import PoseReader, PoseWriter

VALUES = Struct("<dQ4s")


def test_newest_whole_values_are_read_once() -> None:
    memory = bytearray(8 + size_of(VALUES))
    writer, reader = Slot(memory, 8, VALUES), Slot(memory, 8, VALUES)
    with pytest.raises(error):
        writer.write("x", 7, b"")
    assert not any(memory), "values of another format change nothing"
    assert reader.newest() is None
    writer.write(0.5, 7, b"abc")
    assert reader.newest() == (0.5, 7, b"abc\0")
    writer.write(1.0, 7, b"abc")
    writer.write(1.5, 8, b"abcd")
    assert reader.newest() == (1.5, 8, b"abcd")
    assert reader.newest() is None
    Slot(memory, 8, VALUES).write(2.5, 9, b"abcd")  # a second writer goes on counting
    whole = bytes(memory)
    for at in range(8, len(whole)):
        memory[at] ^= 0x40
        assert reader.newest() is None, f"torn at {at}"
        memory[:] = whole
    assert reader.newest() == (2.5, 9, b"abcd")


def test_values_of_another_process_arrive_whole() -> None:
    memory, last = mmap(-1, size_of(VALUES)), 49_999
    if (child := os.fork()) == 0:
        writer = Slot(memory, 0, VALUES)
        for number in range(last + 1):
            writer.write(float(number), number, b"abcd")
        os._exit(0)
    reader, seen = Slot(memory, 0, VALUES), [-1]

    def is_over() -> bool:
        values = reader.newest()
        if values is not None:
            assert values[0] == values[1] > seen[-1]
            seen.append(values[1])
        return seen[-1] == last

    until(is_over, "the last values", pause=0.0)
    os.waitpid(child, 0)


def test_reader_gets_the_newest_pose(tmp_path: Path) -> None:
    path = tmp_path / "weberlink-7.pose"
    writer = PoseWriter(path, 3)
    reader = PoseReader(path)
    assert reader.count == 3 and reader.read() is None
    for number in range(5):
        writer.write(10.0 + number, np.full(3, float(number)))
    pose = reader.read()
    assert pose is not None and pose[0] == 14.0 and pose[1].tolist() == [4.0, 4.0, 4.0]
    assert path.stat().st_mode & 0o777 == 0o600
    writer.close()
    assert not path.exists() and reader.read() is None, "once"
    reader.close()


@pytest.mark.parametrize("content", [b"", b"WEBPOSE\x01", b"nonsense" * 8])
def test_file_without_poses_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "bad.pose"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="holds no poses"):
        PoseReader(path)
