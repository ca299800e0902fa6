"""Strings of bits: integers of few bits, one after the other, the highest bit of each first.

A string that is being made is one integer: a 1, then its bits, so that its length need not be counted beside it. Of a
received one, `bits`, the lowest `left` bits are still to be read.
"""

from collections.abc import Sequence
from typing import Final

WIDTH_BITS: Final = 4
"""Bits that say how wide the numbers of a group are: 1 to 16."""


class MalformedError(ValueError):
    """A received datagram ends too early, or goes on after its end."""


def put_groups(string: int, groups: Sequence[int], numbers: Sequence[int]) -> int:
    """A string with groups of so many int16 numbers appended, each group as wide as its largest number needs."""
    start = 0
    for count in groups:
        group = numbers[start : start + count]
        start += count
        magnitudes = 0
        for number in group:
            magnitudes |= ~number if number < 0 else number
        width = magnitudes.bit_length() + 1
        mask = (1 << width) - 1
        string = string << WIDTH_BITS | width - 1
        for number in group:
            string = string << width | number & mask
    return string


def put_count(string: int, count: int) -> int:
    """A string with 1 <= count < 2**16 appended: the number of bits after its highest one, then those."""
    width = count.bit_length() - 1
    return (string << WIDTH_BITS | width) << width | count - (1 << width)


def to_bytes(string: int) -> bytes:
    """A string, with zeros up to a whole byte."""
    size = string.bit_length() - 1
    unused = -size % 8
    return (string << unused).to_bytes((size + unused) // 8 + 1, "big")[1:]


def take(bits: int, left: int, width: int) -> tuple[int, int]:
    """The next `width` bits, and how many then are left.

    Raises:
        MalformedError: if the string ends too early, as in the functions below.
    """
    left -= width
    if left < 0:
        raise MalformedError(f"expected {-left} bits more")
    return bits >> left & (1 << width) - 1, left


def take_groups(bits: int, left: int, groups: Sequence[int]) -> tuple[tuple[int, ...], int]:
    """The numbers of `put_groups`."""
    numbers: list[int] = []
    for count in groups:
        width, left = take(bits, left, WIDTH_BITS)
        width += 1
        end = left - width * count
        if end < 0:
            raise MalformedError(f"expected {-end} bits more")
        half, mask = 1 << width - 1, (1 << width) - 1
        while left > end:
            left -= width
            numbers.append(((bits >> left & mask) ^ half) - half)
    return tuple(numbers), left


def take_count(bits: int, left: int) -> tuple[int, int]:
    """A number of `put_count`."""
    width, left = take(bits, left, WIDTH_BITS)
    count, left = take(bits, left, width)
    return 1 << width | count, left


def take_rest(bits: int, left: int) -> bytes:
    """The bytes after the present one, whose remaining bits must be 0."""
    zeros, left = take(bits, left, left % 8)
    if zeros:
        raise MalformedError("bits after the end")
    return (bits & (1 << left) - 1).to_bytes(left // 8, "big")


def check_end(bits: int, left: int) -> None:
    """Check that the string ends in this byte, whose remaining bits must be 0."""
    if left >= 8 or bits & (1 << left) - 1:
        raise MalformedError(f"{left} bits after the end")
