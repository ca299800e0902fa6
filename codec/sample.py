"""A sample as both ends hold it, and its conversion to and from wire levels."""

from typing import NamedTuple

from weberlink.codec.quantizer import Quantizer
from weberlink.geometry.vector import Vector

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
    """The grids of one channel in value, position and time.

    Args:
        value: grid of the coded value.
        position: grid of the position that travels with it; None if the value is the position.
        period: time between ticks [s].
    """

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
