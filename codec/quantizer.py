"""The wire's number grid: SI values to integer levels and back."""

from collections.abc import Sequence
from math import isfinite
from typing import Final

from weberlink.geometry.vector import Vector

INT16_MAX = 32_767
LARGEST = 1e150
"""No value and no level is larger, off the wire either: the product of two is still finite."""
_AXIS_INDEX = {"x": 0, "y": 1, "z": 2}


class Quantizer:
    """Uniform mid-tread quantizer on the axes that are sent.

    Levels are Python integers, so a step far below the noise (1e-12) is how an unquantized codec is studied: no second
    code path exists for it.
    """

    __slots__ = ("_indices", "highest", "limit", "lowest", "step")

    def __init__(self, step: float, axes: str = "xyz", *, largest_level: float = INT16_MAX) -> None:
        """Make the grid.

        Args:
            step: distance between two levels, > 0 [N or m].
            axes: the axes that travel, a subset of "xyz" in that order; the others are held at exactly 0.
            largest_level: saturation, symmetric; infinity for none but `LARGEST`.

        Raises:
            ValueError: for a step that is not positive and finite, or for axes that are not a subset of "xyz".
        """
        if not (step > 0.0 and isfinite(step)):
            raise ValueError(f"quantizer step must be positive and finite, not {step!r}")
        if not axes or axes != "".join(axis for axis in "xyz" if axis in axes):
            raise ValueError(f"axes must be a non-empty part of 'xyz' in that order, not {axes!r}")
        self._indices = tuple(_AXIS_INDEX[axis] for axis in axes)
        self.step: Final = step
        self.limit: Final = min(step * min(largest_level, LARGEST), LARGEST)
        """Largest magnitude on one axis that a level can say, in the unit of the step."""
        self.highest: Final = _corner(self.limit, axes)
        self.lowest: Final = _corner(-self.limit, axes)
        """With `highest` the corners of the box of all values that can be said."""

    @property
    def used(self) -> tuple[int, ...]:
        """Indices of the axes that are sent."""
        return self._indices

    @property
    def size(self) -> int:
        """How many levels one vector takes."""
        return len(self._indices)

    def says(self, value: Vector) -> bool:
        """Whether `confine` would leave a value as it is; False for what is not finite."""
        low, high = self.lowest, self.highest
        return low[0] <= value[0] <= high[0] and low[1] <= value[1] <= high[1] and low[2] <= value[2] <= high[2]

    def confine(self, value: Vector) -> Vector:
        """The nearest value that the wire can say but for its step: unused axes at 0, the others within the limit.

        What is not a number on a used axis stays so.
        """
        low, high = self.lowest, self.highest
        if low[0] <= value[0] <= high[0] and low[1] <= value[1] <= high[1] and low[2] <= value[2] <= high[2]:
            return value
        return (_clip(value[0], low[0], high[0]), _clip(value[1], low[1], high[1]), _clip(value[2], low[2], high[2]))

    def levels(self, value: Vector) -> tuple[int, ...]:
        """Wire levels of a finite value, saturated at the limit; error at most half a step per axis within it."""
        confined = self.confine(value)
        step = self.step
        return tuple([level(confined[index], step) for index in self._indices])

    def value(self, levels: tuple[int, ...]) -> Vector:
        """SI value of `size` levels; one beyond the limit, -32768 on the wire, which no encoder sends, counts as it."""
        components = [0.0, 0.0, 0.0]
        for index, each in zip(self._indices, levels, strict=True):
            components[index] = each * self.step
        return self.confine((components[0], components[1], components[2]))

    def components(self, vector: Vector) -> list[float]:
        """Those on the axes that are sent."""
        return [vector[index] for index in self._indices]

    def vector(self, components: Sequence[float]) -> Vector:
        """With so many components on the axes that are sent, and 0 on the others; not rounded, not saturated."""
        all_axes = [0.0, 0.0, 0.0]
        for index, each in zip(self._indices, components, strict=True):
            all_axes[index] = each
        return (all_axes[0], all_axes[1], all_axes[2])

    def rounded(self, value: Vector) -> Vector:
        """What the other end makes of the levels of a finite value."""
        x, y, z = self.confine(value)
        step = self.step
        return self.confine((level(x, step) * step, level(y, step) * step, level(z, step) * step))


def level(component: float, step: float) -> int:
    """The nearest level of a finite component, the even one of two."""
    return round(component / step)


def _corner(limit: float, axes: str) -> Vector:
    x, y, z = (limit if axis in axes else 0.0 for axis in "xyz")
    return (x, y, z)


def _clip(component: float, low: float, high: float) -> float:
    return high if component > high else low if component < low else component
