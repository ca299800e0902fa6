"""A sample as both ends hold it: quantized, and stamped with the sender's tick."""

from typing import NamedTuple

from weberlink.geometry.vector import Vector


class Sample(NamedTuple):
    """A transmitted sample.

    Args:
        tick: sender's tick number.
        value: the coded quantity: force [N] on the backward channel, position [m] on the forward one.
        position: commanded position [m] that the value belongs to; on the forward channel the value itself.
    """

    tick: int
    value: Vector
    position: Vector
