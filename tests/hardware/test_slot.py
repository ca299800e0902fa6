"""A slot between two processes: newest whole values, and nothing else."""

import os
from mmap import mmap
from struct import Struct, error

import pytest

from weberlink.hardware.slot import Slot, size_of

VALUES = Struct("<dQ4s")


def ends() -> tuple[bytearray, Slot, Slot]:
    memory = bytearray(8 + size_of(VALUES))
    return memory, Slot(memory, 8, VALUES), Slot(memory, 8, VALUES)


def test_newest_values_are_read_once() -> None:
    _, writer, reader = ends()
    assert reader.newest() is None
    writer.write(0.5, 7, b"abc")
    writer.write(1.5, 8, b"abcd")
    assert reader.newest() == (1.5, 8, b"abcd")
    assert reader.newest() is None


def test_torn_values_are_left_until_whole() -> None:
    memory, writer, reader = ends()
    writer.write(0.5, 7, b"abcd")
    whole = bytes(memory)
    for at in range(8, len(whole)):
        memory[at] ^= 0x40
        assert reader.newest() is None, at
        memory[:] = whole
    assert reader.newest() == (0.5, 7, b"abcd")


def test_second_writer_goes_on_counting() -> None:
    memory, writer, reader = ends()
    writer.write(0.5, 7, b"abcd")
    assert reader.newest() is not None
    Slot(memory, 8, VALUES).write(2.5, 9, b"abcd")
    assert reader.newest() == (2.5, 9, b"abcd")


def test_values_of_another_format_change_nothing() -> None:
    memory, writer, _ = ends()
    with pytest.raises(error):
        writer.write("x", 7, b"")
    assert not any(memory)


def test_values_of_another_process_arrive_whole() -> None:
    memory = mmap(-1, size_of(VALUES))
    if (child := os.fork()) == 0:
        writer = Slot(memory, 0, VALUES)
        for number in range(50_000):
            writer.write(float(number), number, b"abcd")
        os._exit(0)
    reader, seen = Slot(memory, 0, VALUES), [-1]
    while seen[-1] < 49_999:
        values = reader.newest()
        if values is not None:
            assert values[0] == values[1]
            seen.append(values[1])
        elif os.waitpid(child, os.WNOHANG)[0]:
            child = 0
            break
    if child:
        os.waitpid(child, 0)
    last = reader.newest()
    assert seen == sorted(set(seen))
    assert (seen[-1] if last is None else last[1]) == 49_999
