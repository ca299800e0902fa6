"""Strings of bits: integers of few bits, one after the other, the highest bit of each first."""

from collections.abc import Sequence

WIDTH_BITS = 4
"""Bits that say how wide the numbers of a group are: 1 to 16."""


class MalformedError(ValueError):
    """A received datagram ends too early, or goes on after its end."""


class BitWriter:
    """Makes a string of bits."""

    __slots__ = ("_bits", "_size")

    def __init__(self) -> None:
        self._bits = self._size = 0

    def put(self, value: int, width: int) -> None:
        """Append 0 <= value < 2**width."""
        self._bits = self._bits << width | value
        self._size += width

    def put_group(self, numbers: Sequence[int]) -> None:
        """Append int16 numbers in as many bits each, two's complement, as the largest of them needs."""
        width = max(1, max((~number if number < 0 else number).bit_length() for number in numbers) + 1)
        mask = (1 << width) - 1
        bits = self._bits << WIDTH_BITS | width - 1
        for number in numbers:
            bits = bits << width | number & mask
        self._bits = bits
        self._size += WIDTH_BITS + width * len(numbers)

    def put_count(self, count: int) -> None:
        """Append 1 <= count < 2**16: the number of bits after its highest one, then those."""
        width = count.bit_length() - 1
        self.put(width, WIDTH_BITS)
        self.put(count - (1 << width), width)

    def to_bytes(self) -> bytes:
        """The string, with zeros up to a whole byte."""
        unused = -self._size % 8
        return (self._bits << unused).to_bytes((self._size + unused) // 8, "big")


class BitReader:
    """Reads a string of bits; each method raises `MalformedError` if it ends too early."""

    __slots__ = ("_bits", "_left", "_size")

    def __init__(self, data: bytes) -> None:
        self._bits = int.from_bytes(data, "big")
        self._left = self._size = 8 * len(data)

    def take(self, width: int) -> int:
        """The next `width` bits."""
        left = self._left - width
        if left < 0:
            raise MalformedError(f"{self._size} bits, expected {-left} more")
        self._left = left
        return self._bits >> left & (1 << width) - 1

    def take_group(self, count: int) -> tuple[int, ...]:
        """As many numbers of `BitWriter.put_group`."""
        width = self.take(WIDTH_BITS) + 1
        bits, half, mask = self.take(width * count), 1 << width - 1, (1 << width) - 1
        return tuple([((bits >> shift & mask) ^ half) - half for shift in range(width * (count - 1), -1, -width)])

    def take_count(self) -> int:
        """A number of `BitWriter.put_count`."""
        width = self.take(WIDTH_BITS)
        return 1 << width | self.take(width)

    def rest(self) -> bytes:
        """The bytes after the present one, whose remaining bits must be 0."""
        self.take_zeros(self._left % 8)
        left, self._left = self._left, 0
        return (self._bits & (1 << left) - 1).to_bytes(left // 8, "big")

    def end(self) -> None:
        """Check that the string ends in this byte, whose remaining bits must be 0."""
        if self._left >= 8:
            raise MalformedError(f"{self._left // 8} bytes more than expected")
        self.take_zeros(self._left)

    def take_zeros(self, width: int) -> None:
        if self.take(width):
            raise MalformedError("bits after the end")
