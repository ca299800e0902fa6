"""A sample as both ends hold it, and its conversion to and from wire levels."""

from math import isfinite
from typing import Final, NamedTuple

from weberlink.geometry.vector import Vector

INT16_MAX = 32_767
LARGEST = 1e150  # Upper limit of values and levels, also where saturation is off: the product of two is still finite


class Quantizer:
    """Uniform mid-tread quantizer on the axes that are sent.

    Levels are Python integers. To study the codec without quantization, choose a step far below the noise (1e-12).

    Args:
        step: distance between two levels, > 0 [N or m].
        axes: the axes that are sent, a subset of "xyz" in that order; the others are exactly 0.
        largest_level: saturation, symmetric; with infinity, `LARGEST` is the only limit.

    Raises:
        ValueError: for a step or axes that are not so.
    """

    __slots__ = ("_places", "_sent", "highest", "limit", "lowest", "size", "step", "used")

    def __init__(self, step: float, axes: str = "xyz", *, largest_level: float = INT16_MAX) -> None:
        if not (step > 0.0 and isfinite(step)):
            raise ValueError(f"quantizer step must be positive and finite, not {step!r}")
        if not axes or axes != "".join(axis for axis in "xyz" if axis in axes):
            raise ValueError(f"axes must be a non-empty subset of 'xyz' in that order, not {axes!r}")
        used = tuple("xyz".index(axis) for axis in axes)
        self.used: Final = used  # indices of the axes that are sent
        self.size: Final = len(used)
        self.step: Final = step
        self.limit: Final = min(step * min(largest_level, LARGEST), LARGEST)  # largest magnitude on an axis
        x, y, z = (self.limit if axis in axes else 0.0 for axis in "xyz")
        self.highest: Final = (x, y, z)  # with `lowest`, opposite corners of the box of all values in range
        self.lowest: Final = (-x if x else 0.0, -y if y else 0.0, -z if z else 0.0)
        # Every subset of three axes is a slice; the place of an axis that is not sent is that of a 0 behind the levels.
        self._sent: Final = slice(used[0], used[-1] + 1, used[1] - used[0] if len(used) > 1 else 1)
        i, j, k = (axes.find(axis) for axis in "xyz")
        self._places: Final = (i, j, k)

    def confine(self, value: Vector) -> Vector:
        """Saturate a value: 0 on the axes that are not sent, within the limit on the others. NaN stays NaN there."""
        low, high = self.lowest, self.highest
        if low[0] <= value[0] <= high[0] and low[1] <= value[1] <= high[1] and low[2] <= value[2] <= high[2]:
            return value
        return (_clip(value[0], low[0], high[0]), _clip(value[1], low[1], high[1]), _clip(value[2], low[2], high[2]))

    def quantize(self, value: Vector) -> tuple[tuple[int, ...], Vector]:
        """Wire levels of a finite value, saturated, and the value that they stand for.

        Of two levels that are equally near, the even one. Within the limit the error is at most half a step per axis.
        """
        x, y, z = self.confine(value)
        step, limit = self.step, self.limit
        i, j, k = round(x / step), round(y / step), round(z / step)
        levels: tuple[int, ...] = (i, j, k)
        x, y, z = i * step, j * step, k * step
        if -limit <= x <= limit and -limit <= y <= limit and -limit <= z <= limit:
            return levels[self._sent], (x, y, z)
        return levels[self._sent], self.confine((x, y, z))

    def value(self, levels: tuple[int, ...]) -> Vector:
        """SI value of `size` levels. A level beyond the limit (-32768, which no encoder sends) counts as the limit."""
        step, limit, (i, j, k), padded = self.step, self.limit, self._places, (*levels, 0)
        x, y, z = padded[i] * step, padded[j] * step, padded[k] * step
        if -limit <= x <= limit and -limit <= y <= limit and -limit <= z <= limit:
            return (x, y, z)
        return self.confine((x, y, z))


def _clip(component: float, low: float, high: float) -> float:
    return high if component > high else low if component < low else component


UNKNOWN: Vector = (float("nan"),) * 3  # The position of a sample that was sent without one; always this object


class Sample(NamedTuple):
    """A transmitted sample, quantized."""

    tick: int  # of the sender
    value: Vector  # the coded quantity: force [N] on the backward channel, position [m] on the forward one
    position: Vector  # commanded, of a force [m]; `UNKNOWN` if the update did not carry it; of a position the value


class SampleGrid:
    """The grids of value and position (None if that is the value), and the time between ticks [s]."""

    __slots__ = ("groups", "period", "position", "size", "value")

    def __init__(self, value: Quantizer, position: Quantizer | None = None, period: float = 1e-3) -> None:
        self.value: Final = value
        self.position: Final = position
        self.period: Final = period
        # Numbers of levels of the value, and of the position that travels with it.
        self.groups: Final[tuple[int, ...]] = (value.size,) if position is None else (value.size, position.size)
        self.size: Final = sum(self.groups)

    def quantize(self, tick: int, value: Vector, position: Vector) -> tuple[tuple[int, ...], Sample]:
        """Wire levels of a finite sample, those of the value first, and the sample as both ends hold it."""
        levels, rounded = self.value.quantize(value)
        if self.position is None:
            return levels, Sample(tick, rounded, rounded)
        of_position, place = self.position.quantize(position)
        return levels + of_position, Sample(tick, rounded, place)

    def sample(self, tick: int, levels: tuple[int, ...]) -> Sample:
        """The sample of `size` levels, as both ends hold it; without a position if `levels` are those of the value."""
        size = self.value.size
        value = self.value.value(levels[:size])
        if self.position is None:
            return Sample(tick, value, value)
        return Sample(tick, value, self.position.value(levels[size:]) if len(levels) > size else UNKNOWN)
