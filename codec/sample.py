"""A sample as both ends hold it, and its conversion to and from wire levels."""

from typing import NamedTuple

from weberlink.codec.quantizer import Quantizer
from weberlink.geometry.vector import Vector


class Sample(NamedTuple):
    """A transmitted sample, quantized.

    Args:
        tick: sender's tick number.
        value: the coded quantity: force [N] on the backward channel, position [m] on the forward one.
        position: commanded position [m] at which the force was measured; on the forward channel the value itself.
    """

    tick: int
    value: Vector
    position: Vector


class SampleGrid(NamedTuple):
    """The wire grids of one channel.

    Args:
        value: grid of the coded value.
        position: grid of the position that travels with it; None if the value is the position.
    """

    value: Quantizer
    position: Quantizer | None = None

    @property
    def size(self) -> int:
        """Number of integers of one sample on the wire, 1 to 6."""
        return self.value.size + (self.position.size if self.position is not None else 0)

    def levels(self, value: Vector, position: Vector) -> tuple[int, ...]:
        """Wire levels of a finite sample: those of the value, then those of the position."""
        if self.position is None:
            return self.value.levels(value)
        return self.value.levels(value) + self.position.levels(position)

    def sample(self, tick: int, levels: tuple[int, ...]) -> Sample:
        """The sample of `size` levels, as both ends hold it."""
        value = self.value.value(levels[: self.value.size])
        if self.position is None:
            return Sample(tick, value, value)
        return Sample(tick, value, self.position.value(levels[self.value.size :]))
