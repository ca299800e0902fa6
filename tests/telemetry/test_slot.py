"""A slot between two processes: newest whole values, and nothing else."""

import os
from mmap import mmap
from struct import Struct, error

import pytest

from tests.wait import until
from weberlink.slot import Slot, size_of

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
