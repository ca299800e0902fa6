"""Strings of bits: integers of few bits, one after the other, the highest bit of each first.

A string that is being made is one integer: a 1, then its bits. So its length need not be counted beside it.
"""

from collections.abc import Sequence
from typing import Final

WIDTH_BITS: Final = 4
"""Bits that say how wide the numbers of a group are: 1 to 16."""


class MalformedError(ValueError):
    """A received datagram ends too early, or goes on after its end."""


def put_group(string: int, numbers: Sequence[int]) -> int:
    """A string with int16 numbers appended, in as many bits each, two's complement, as the largest of them needs."""
    magnitudes = 0
    for number in numbers:
        magnitudes |= ~number if number < 0 else number
    width = magnitudes.bit_length() + 1
    mask = (1 << width) - 1
    string = string << WIDTH_BITS | width - 1
    for number in numbers:
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
    """The next `width` bits of a received string, of which the lowest `left` bits are left; and how many then are.

    Raises:
        MalformedError: if the string ends too early, as in the functions below.
    """
    left -= width
    if left < 0:
        raise MalformedError(f"expected {-left} bits more")
    return bits >> left & (1 << width) - 1, left


def take_group(bits: int, left: int, count: int) -> tuple[tuple[int, ...], int]:
    """As many numbers of `put_group`."""
    width, left = take(bits, left, WIDTH_BITS)
    width += 1
    group, left = take(bits, left, width * count)
    half, mask = 1 << width - 1, (1 << width) - 1
    return tuple([((group >> shift & mask) ^ half) - half for shift in range(width * (count - 1), -1, -width)]), left


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


def end(bits: int, left: int) -> None:
    """Check that the string ends in this byte, whose remaining bits must be 0."""
    if left >= 8 or bits & (1 << left) - 1:
        raise MalformedError(f"{left} bits after the end")
