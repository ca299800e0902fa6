"""Numbers of a model as a string of bits."""

from collections.abc import Sequence
from math import frexp, ldexp
from typing import NamedTuple

EXPONENT_BITS = 5
_LARGEST_EXPONENT = (1 << EXPONENT_BITS) - 1


def pack(values: Sequence[int], widths: Sequence[int]) -> int:
    """The bits of fields, each 0 <= value < 2**width; the last field is in the lowest bits."""
    bits = 0
    for value, width in zip(values, widths, strict=True):
        bits = bits << width | value
    return bits


def unpack(bits: int, widths: Sequence[int]) -> list[int]:
    """The fields again; whatever the bits, each is within its width."""
    values = []
    for width in reversed(widths):
        values.append(bits & ((1 << width) - 1))
        bits >>= width
    values.reverse()
    return values


class Block(NamedTuple):
    """Numbers of one kind under a common exponent: the largest has `width` - 1 digits, the others as many fewer.

    Args:
        unit: of the last digit at exponent 0, > 0.
        width: bits of a number, with its sign, >= 2.
        size: how many they are.
    """

    unit: float
    width: int
    size: int

    @property
    def widths(self) -> tuple[int, ...]:
        return (EXPONENT_BITS, *(self.width,) * self.size)

    def levels(self, numbers: Sequence[float]) -> list[int]:
        """Towards zero, so that what must stay within a bound does, to a rounding; saturated. All must be finite."""
        top = (1 << (self.width - 1)) - 1
        largest = max(map(abs, numbers)) / self.unit
        beyond = frexp(largest / (top + 1))[1] if largest < 1e300 else _LARGEST_EXPONENT
        exponent = min(max(0, beyond), _LARGEST_EXPONENT)
        digit = ldexp(self.unit, exponent)
        return [exponent, *(max(-top, min(top, int(max(-1e9, min(1e9, number / digit))))) + top for number in numbers)]

    def numbers(self, levels: Sequence[int]) -> list[float]:
        top = (1 << (self.width - 1)) - 1
        digit = ldexp(self.unit, levels[0])
        return [(level - top) * digit for level in levels[1:]]


class Float(NamedTuple):
    """A number whose relative error matters: a small float, off by at most one part in 2**(digits + 1).

    No logarithm is taken, which every library rounds as it likes: two hosts decode the same number.

    Args:
        low: smallest magnitude, > 0.
        octaves: bits of the exponent; 2**octaves doublings of `low` can be said.
        digits: bits behind the leading one.
        signed: whether there is a sign, and a magnitude below `low` is 0; otherwise it is `low`.
    """

    low: float
    octaves: int
    digits: int
    signed: bool = False

    @property
    def width(self) -> int:
        return self.octaves + self.digits + self.signed

    def level(self, number: float) -> int:
        """The nearest, saturated."""
        size = abs(number) / self.low
        if self.signed and not size >= 1.0:
            return 0
        mantissa, exponent = frexp(min(max(size, 1.0), 1e300))
        level = (exponent - 1 << self.digits) + round((2.0 * mantissa - 1.0) * (1 << self.digits))
        level = min(level, (1 << self.octaves + self.digits) - 1)
        if not self.signed:
            return level
        # The sign is the lowest bit; level 0 of a positive number is that of 0, so the smallest is said as the next.
        return max(level << 1 | (number < 0.0), 1 if number < 0.0 else 2)

    def number(self, level: int) -> float:
        if self.signed:
            if level == 0:
                return 0.0
            magnitude = self._magnitude(level >> 1)
            return -magnitude if level & 1 else magnitude
        return self._magnitude(level)

    def _magnitude(self, level: int) -> float:
        exponent, digits = level >> self.digits, level & (1 << self.digits) - 1
        return self.low * ldexp(1.0 + digits / (1 << self.digits), exponent)


class Uniform(NamedTuple):
    """A number from `low` in equal steps.

    Args:
        low: of level 0.
        step: > 0.
        width: bits.
    """

    low: float
    step: float
    width: int

    def level(self, number: float) -> int:
        """The nearest, saturated."""
        return max(0, min((1 << self.width) - 1, round((number - self.low) / self.step)))

    def number(self, level: int) -> float:
        return self.low + level * self.step
