"""A slot in shared memory for one struct, written by one process and read by another without waiting.

The values are stored together with a number, which rises with each write, and a checksum over both. So a reader
recognises values that are only partly written on any processor, and takes them at its next look.
"""

from mmap import mmap
from struct import Struct
from typing import Any
from zlib import crc32

NUMBER = Struct("<Q")
CHECK = Struct("<I")


class Slot:
    """One end of a slot, which begins at a byte of shared memory; the values have a little-endian format, "<..."."""

    __slots__ = ("_at", "_body", "_end", "_memory", "_number")

    def __init__(self, memory: mmap | bytearray | memoryview, at: int, values: Struct) -> None:
        self._memory = memory
        self._body = Struct(f"<Q{values.format.removeprefix('<')}")
        self._at, self._end = at, at + size_of(values)
        self._number = 0

    def write(self, *values: Any) -> None:
        """Replace the values; struct.error if they do not fit the format."""
        at = self._at
        (last,) = NUMBER.unpack(self._memory[at : at + NUMBER.size])
        body = self._body.pack(last + 1, *values)
        self._memory[at : self._end] = body + CHECK.pack(crc32(body))

    def newest(self) -> tuple[Any, ...] | None:
        """The values, if they are others than at the last call and whole; None otherwise. Never waits."""
        data = self._memory[self._at : self._end]
        (number,) = NUMBER.unpack_from(data)
        if number == self._number:
            return None
        body = data[: self._body.size]
        if CHECK.unpack_from(data, self._body.size)[0] != crc32(body):
            return None
        self._number = number
        return self._body.unpack(body)[1:]


def size_of(values: Struct) -> int:
    """What a slot for these values takes [byte]."""
    return NUMBER.size + values.size + CHECK.size
