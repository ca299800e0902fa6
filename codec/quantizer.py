"""The wire's number grid: SI values to integer levels and back."""

from math import inf, isfinite

from codec.vector import Vector

INT16_MAX = 32_767
_AXIS_INDEX = {"x": 0, "y": 1, "z": 2}


class Quantizer:
    """Uniform mid-tread quantizer on the axes that are sent.

    Levels are Python integers, so a step far below the noise (1e-12) is how an unquantized codec is studied: no second
    code path exists for it.
    """

    __slots__ = ("_indices", "_limit", "_step")

    def __init__(self, step: float, axes: str = "xyz", *, largest_level: float = INT16_MAX) -> None:
        """Make the grid.

        Args:
            step: distance between two levels, > 0 [N or m].
            axes: the axes that travel, a subset of "xyz" in that order; the others are held at exactly 0.
            largest_level: saturation, symmetric; infinity for none.

        Raises:
            ValueError: for a step that is not positive and finite, or for axes that are not a subset of "xyz".
        """
        if not (step > 0.0 and isfinite(step)):
            raise ValueError(f"quantizer step must be positive and finite, not {step!r}")
        if not axes or axes != "".join(axis for axis in "xyz" if axis in axes):
            raise ValueError(f"axes must be a non-empty part of 'xyz' in that order, not {axes!r}")
        self._step = step
        self._indices = tuple(_AXIS_INDEX[axis] for axis in axes)
        self._limit = step * largest_level if largest_level < inf else inf

    @property
    def step(self) -> float:
        return self._step

    @property
    def limit(self) -> float:
        """Largest magnitude on one axis that a level can say, in the unit of the step."""
        return self._limit

    @property
    def size(self) -> int:
        """How many levels one vector takes."""
        return len(self._indices)

    def confine(self, value: Vector) -> Vector:
        """The nearest value that the wire can say but for its step: unused axes at 0, the others within the limit."""
        limit = self._limit
        components = [0.0, 0.0, 0.0]
        for index in self._indices:
            component = value[index]
            components[index] = limit if component > limit else -limit if component < -limit else component
        return (components[0], components[1], components[2])

    def levels(self, value: Vector) -> tuple[int, ...]:
        """Wire levels of a finite value, saturated at the limit; error at most half a step per axis within it."""
        confined = self.confine(value)
        return tuple(round(confined[index] / self._step) for index in self._indices)

    def value(self, levels: tuple[int, ...]) -> Vector:
        """SI value of `size` levels."""
        components = [0.0, 0.0, 0.0]
        for index, level in zip(self._indices, levels, strict=True):
            components[index] = level * self._step
        return (components[0], components[1], components[2])
