"""Number formats of model parameters, and their packing into bytes."""

from collections.abc import Sequence
from math import frexp, ldexp
from typing import NamedTuple

from weberlink.codec.sample import Quantizer
from weberlink.geometry.vector import Vector

EXPONENT_BITS = 5
_LARGEST_EXPONENT = (1 << EXPONENT_BITS) - 1


def pack(values: Sequence[int], widths: Sequence[int]) -> bytes:
    """Pack fields, each 0 <= value < 2**width, from the highest bit on; bytes of 0 at the end are left out.

    So put the fields last that are 0 in a simple model.
    """
    bits = 0
    for value, width in zip(values, widths, strict=True):
        bits = bits << width | value
    unused = -sum(widths) % 8
    return (bits << unused).to_bytes((sum(widths) + unused) // 8, "big").rstrip(b"\0")


def unpack(data: bytes, widths: Sequence[int]) -> list[int]:
    """The fields of any bytes, each within its width and 0 beyond the end; raises ValueError for more bytes."""
    unused = -sum(widths) % 8
    size = (sum(widths) + unused) // 8
    if len(data) > size:
        raise ValueError(f"update carries {len(data)} bytes of model parameters, expected at most {size}")
    bits = int.from_bytes(data.ljust(size, b"\0"), "big") >> unused
    values = []
    for width in reversed(widths):
        values.append(bits & ((1 << width) - 1))
        bits >>= width
    values.reverse()
    return values


def components(vector: Vector, quantizer: Quantizer) -> list[float]:
    """Those of a vector on the axes that are sent."""
    return [vector[axis] for axis in quantizer.used]


def vector_of(components: Sequence[float], quantizer: Quantizer) -> Vector:
    """The vector with these components on the axes that are sent, and 0 on the others."""
    sent = dict(zip(quantizer.used, components, strict=True))
    return (sent.get(0, 0.0), sent.get(1, 0.0), sent.get(2, 0.0))


class Block(NamedTuple):
    """A block floating-point format: `size` numbers with a common exponent, set by the largest of them.

    `unit` is the value of the last bit at exponent 0; `width` are the bits of a number, with its sign (>= 2).
    """

    unit: float
    width: int
    size: int

    @property
    def widths(self) -> tuple[int, ...]:
        return (EXPONENT_BITS, *(self.width,) * self.size)

    def levels(self, numbers: Sequence[float]) -> list[int]:
        """The exponent, then one level per number. Finite numbers are rounded towards zero and saturated.

        So a decoded number never exceeds a bound of the number, except by a rounding error.
        """
        top = (1 << (self.width - 1)) - 1
        largest = max(map(abs, numbers)) / self.unit
        beyond = frexp(largest / (top + 1))[1] if largest < 1e300 else _LARGEST_EXPONENT
        exponent = min(max(0, beyond), _LARGEST_EXPONENT)
        digit = ldexp(self.unit, exponent)
        mask = (1 << self.width) - 1
        return [exponent, *(max(-top, min(top, int(max(-1e9, min(1e9, number / digit))))) & mask for number in numbers)]

    def numbers(self, levels: Sequence[int]) -> list[float]:
        half = 1 << (self.width - 1)
        digit = ldexp(self.unit, levels[0])
        return [(level - 2 * half if level >= half else level) * digit for level in levels[1:]]


class Float(NamedTuple):
    """A small floating-point format: 2**`octaves` doublings of the magnitude `low`, with `digits` bits of fraction.

    The relative error is at most 2**-(digits + 1), except of the smallest positive signed number, which is encoded as
    the next one. Signed, a magnitude below `low` becomes 0, otherwise `low`. No logarithm is used, because its rounding
    depends on the library: two hosts decode the same number.
    """

    low: float
    octaves: int
    digits: int
    signed: bool = False

    @property
    def width(self) -> int:
        return self.octaves + self.digits + self.signed

    def level(self, number: float) -> int:
        """The nearest level, saturated."""
        size = abs(number) / self.low
        if self.signed and not size >= 1.0:
            return 0
        mantissa, exponent = frexp(min(max(size, 1.0), 1e300))
        level = (exponent - 1 << self.digits) + round((2.0 * mantissa - 1.0) * (1 << self.digits))
        level = min(level, (1 << self.octaves + self.digits) - 1)
        if not self.signed:
            return level
        # The sign is the lowest bit. Level 0 stands for 0, so the smallest positive number takes the next level, 2.
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
    """Numbers in equal steps: level 0 is `low`, and `width` are the bits of a level."""

    low: float
    step: float
    width: int

    def level(self, number: float) -> int:
        """The nearest level, saturated."""
        return max(0, min((1 << self.width) - 1, round((number - self.low) / self.step)))

    def number(self, level: int) -> float:
        return self.low + level * self.step
