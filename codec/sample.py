"""A sample as both ends hold it, and its conversion to and from wire levels."""

from collections.abc import Sequence
from math import isfinite
from typing import Final, NamedTuple

from weberlink.geometry.vector import Vector

INT16_MAX = 32_767
LARGEST = 1e150
"""Upper limit of values and levels, also where saturation is off: the product of two is still finite."""


class Quantizer:
    """Uniform mid-tread quantizer on the axes that are sent.

    Levels are Python integers. To study the codec without quantization, choose a step far below the noise (1e-12).
    """

    __slots__ = ("highest", "limit", "lowest", "step", "used")

    def __init__(self, step: float, axes: str = "xyz", *, largest_level: float = INT16_MAX) -> None:
        """Make the grid.

        Args:
            step: distance between two levels, > 0 [N or m].
            axes: the axes that are sent, a subset of "xyz" in that order; the others are exactly 0.
            largest_level: saturation, symmetric; with infinity, `LARGEST` is the only limit.

        Raises:
            ValueError: for a step or axes that are not so.
        """
        if not (step > 0.0 and isfinite(step)):
            raise ValueError(f"quantizer step must be positive and finite, not {step!r}")
        if not axes or axes != "".join(axis for axis in "xyz" if axis in axes):
            raise ValueError(f"axes must be a non-empty subset of 'xyz' in that order, not {axes!r}")
        self.used: Final = tuple("xyz".index(axis) for axis in axes)
        """Indices of the axes that are sent."""
        self.step: Final = step
        self.limit: Final = min(step * min(largest_level, LARGEST), LARGEST)
        """Largest magnitude on one axis, in the unit of the step."""
        self.highest: Final = _corner(self.limit, axes)
        self.lowest: Final = _corner(-self.limit, axes)
        """`lowest` and `highest` are opposite corners of the box of all values in range."""

    @property
    def size(self) -> int:
        """Number of levels of one vector, 1 to 3."""
        return len(self.used)

    def in_range(self, value: Vector) -> bool:
        """Whether `confine` would leave a value as it is; False if it is not finite."""
        low, high = self.lowest, self.highest
        return low[0] <= value[0] <= high[0] and low[1] <= value[1] <= high[1] and low[2] <= value[2] <= high[2]

    def confine(self, value: Vector) -> Vector:
        """Saturate a value: 0 on the axes that are not sent, within the limit on the others. NaN stays NaN there."""
        low, high = self.lowest, self.highest
        if low[0] <= value[0] <= high[0] and low[1] <= value[1] <= high[1] and low[2] <= value[2] <= high[2]:
            return value
        return (_clip(value[0], low[0], high[0]), _clip(value[1], low[1], high[1]), _clip(value[2], low[2], high[2]))

    def levels(self, value: Vector) -> tuple[int, ...]:
        """Wire levels of a finite value, saturated; within the limit the error is at most half a step per axis."""
        confined = self.confine(value)
        step = self.step
        return tuple([level(confined[index], step) for index in self.used])

    def value(self, levels: tuple[int, ...]) -> Vector:
        """SI value of `size` levels. A level beyond the limit (-32768, which no encoder sends) counts as the limit."""
        return self.confine(self.vector([each * self.step for each in levels]))

    def components(self, vector: Vector) -> list[float]:
        """The `size` components of a vector on the axes that are sent."""
        return [vector[index] for index in self.used]

    def vector(self, components: Sequence[float]) -> Vector:
        """The vector with these `size` components, and 0 on the other axes; neither rounded nor saturated."""
        all_axes = [0.0, 0.0, 0.0]
        for index, each in zip(self.used, components, strict=True):
            all_axes[index] = each
        return (all_axes[0], all_axes[1], all_axes[2])

    def rounded(self, value: Vector) -> Vector:
        """A finite value as the other end decodes it: `value(levels(value))`."""
        x, y, z = self.confine(value)
        step = self.step
        return self.confine((level(x, step) * step, level(y, step) * step, level(z, step) * step))


def level(component: float, step: float) -> int:
    """The nearest level of a finite component; the even one where two are equally near."""
    return round(component / step)


def _corner(limit: float, axes: str) -> Vector:
    x, y, z = (limit if axis in axes else 0.0 for axis in "xyz")
    return (x, y, z)


def _clip(component: float, low: float, high: float) -> float:
    return high if component > high else low if component < low else component


UNKNOWN: Vector = (float("nan"),) * 3
"""The position of a sample that was sent without one; always this object."""


class Sample(NamedTuple):
    """A transmitted sample, quantized.

    Args:
        tick: sender's tick number.
        value: the coded quantity: force [N] on the backward channel, position [m] on the forward one.
        position: commanded position [m] at which the force was measured; `UNKNOWN` if the update did not carry it; on
            the forward channel the value itself.
    """

    tick: int
    value: Vector
    position: Vector


class SampleGrid(NamedTuple):
    """The grids of value and position (None if that is the value), and the time between ticks [s]."""

    value: Quantizer
    position: Quantizer | None = None
    period: float = 1e-3

    @property
    def size(self) -> int:
        """Number of levels of a sample with its position, 1 to 6."""
        return sum(self.groups)

    @property
    def groups(self) -> tuple[int, ...]:
        """Numbers of levels of the value and of the position that travels with it."""
        return (self.value.size,) if self.position is None else (self.value.size, self.position.size)

    def levels(self, value: Vector, position: Vector) -> tuple[int, ...]:
        """Wire levels of a finite sample: those of the value, then those of the position."""
        if self.position is None:
            return self.value.levels(value)
        return self.value.levels(value) + self.position.levels(position)

    def sample(self, tick: int, levels: tuple[int, ...]) -> Sample:
        """The sample of `size` levels, as both ends hold it; without a position if `levels` are those of the value."""
        value = self.value.value(levels[: self.value.size])
        if self.position is None:
            return Sample(tick, value, value)
        of_position = levels[self.value.size :]
        return Sample(tick, value, self.position.value(of_position) if of_position else UNKNOWN)
