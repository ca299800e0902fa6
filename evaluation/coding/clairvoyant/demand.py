"""What the law of the deadband asks of a decoder at every tick, whatever it predicts with."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec import Channel
from codec.quantizer import Quantizer

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

ROUNDING = 1e-9
"""Share by which a deadband is widened: the encoder's arithmetic is not ours, and the bound must not be above it."""
LEAST_ROUNDING = 1e-12
"""The same as a share of the largest force: what extrapolation from there rounds."""


@dataclass(frozen=True)
class Demand:
    """A decoded force within `tolerance` of `force` is what the law asks.

    Args:
        force: as the encoder sees it, confined to the wire's axes and range, shape (n, 3) [N].
        position: where the decoder evaluates a model, shape (n, 3) [m].
        tolerance: the deadband or the error of the wire's own grid, whichever is more, shape (n,) [N].
        at_edge: whether a decoder that saturates could keep the law with a prediction that does not, shape (n,).
    """

    force: Array
    position: Array
    tolerance: Array
    at_edge: Flags

    @property
    def ticks(self) -> int:
        return len(self.force)

    @property
    def used(self) -> NDArray[np.int64]:
        """The axes on which there is a force or a motion; at least one."""
        used = (self.force != 0.0).any(axis=0) | (self.position != self.position[0]).any(axis=0)
        return np.flatnonzero(used) if used.any() else np.array([0])

    @property
    def collinear(self) -> bool:
        """Whether force and motion are on one axis, the same."""
        return len(self.used) == 1

    def first_broken(self, held: tuple[float, float, float] | None) -> int:
        """The first tick at which a decoder that holds a value breaks the law; n if none, 0 if it holds nothing."""
        if held is None:
            return 0
        broken = lengths(self.force - np.array(held)) > self.tolerance
        return int(broken.argmax()) if broken.any() else self.ticks


def demand_of(force: Array, position: Array, weber: float, floor: float, channel: Channel) -> Demand:
    """What a force channel's encoder asks, with the measured force as the reference of Weber's law.

    An error that the sample's own quantization would not make smaller is not sent.

    Args:
        force: measured, shape (n, 3) [N], finite.
        position: commanded, shape (n, 3) [m], finite.
        weber: Weber factor k.
        floor: absolute threshold [N].
        channel: for the wire; its own deadband is not read.
    """
    wire = channel.value_quantizer
    seen = _confined(force, wire)
    place = position if channel.position_quantizer is None else _confined(position, channel.position_quantizer)
    grid_error = lengths(_confined(np.rint(seen / wire.step) * wire.step, wire) - seen)
    law = np.maximum(np.maximum(weber * lengths(seen), floor), grid_error)
    tolerance = (1.0 + ROUNDING) * law + LEAST_ROUNDING * np.abs(seen).max(initial=0.0)
    at_edge = (np.abs(seen) + tolerance[:, None] >= wire.limit).any(axis=1)
    return Demand(seen, place, tolerance, at_edge)


def lengths(vectors: Array) -> Array:
    """Of each row."""
    x, y, z = vectors.T
    total: Array = np.sqrt(x * x + y * y + z * z)
    return total


def _confined(values: Array, wire: Quantizer) -> Array:
    """As the quantizer confines, all ticks at once; it confines infinity to the corners of its range."""
    inf = np.inf
    confined: Array = np.clip(values, wire.confine((-inf, -inf, -inf)), wire.confine((inf, inf, inf)))
    return confined
