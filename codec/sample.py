"""A sample as both ends hold it, and the grid of integers on which it travels."""

from typing import NamedTuple

from weberlink.codec.quantizer import Quantizer
from weberlink.geometry.vector import Vector


class Sample(NamedTuple):
    """A transmitted sample, quantized.

    Args:
        tick: sender's tick number.
        value: the coded quantity: force [N] on the backward channel, position [m] on the forward one.
        position: commanded position [m] that the value belongs to; on the forward channel the value itself.
    """

    tick: int
    value: Vector
    position: Vector


class SampleGrid(NamedTuple):
    """The wire grids of one channel.

    Args:
        value: of the coded value.
        position: of the position that travels with it; None where the value is the position.
    """

    value: Quantizer
    position: Quantizer | None = None

    @property
    def size(self) -> int:
        """Integers of one sample on the wire."""
        return self.value.size + (self.position.size if self.position is not None else 0)

    def levels(self, value: Vector, position: Vector) -> tuple[int, ...]:
        """Wire levels of a finite sample."""
        if self.position is None:
            return self.value.levels(value)
        return self.value.levels(value) + self.position.levels(position)

    def sample(self, tick: int, levels: tuple[int, ...]) -> Sample:
        """The sample that `size` levels stand for, as both ends hold it."""
        value = self.value.value(levels[: self.value.size])
        if self.position is None:
            return Sample(tick, value, value)
        return Sample(tick, value, self.position.value(levels[self.value.size :]))
