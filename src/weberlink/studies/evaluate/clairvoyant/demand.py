"""What the law of the deadband asks of a decoder at every tick, whatever it predicts with."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from weberlink.codec import Channel
from weberlink.codec.deadband import ConeDeadband, Deadband, ForceDeadband, LevelCrossingDeadband, VelocityDeadband
from weberlink.codec.quantizer import Quantizer
from weberlink.geometry.vector import ZERO
from weberlink.studies.evaluate.clairvoyant.sector import ROUNDING, Sector, sector_of

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LEAST_ROUNDING = 1e-12
"""The same as a share of the largest force: what extrapolation from there rounds."""


@dataclass(frozen=True)
class Demand:
    """A decoded force within `tolerance` of `force` is what the law asks, and in the sector if there is one.

    Args:
        force: as the encoder sees it, confined to the wire's axes and range, shape (n, 3) [N].
        position: where the decoder evaluates a model, shape (n, 3) [m].
        tolerance: the deadband or the error of the wire's own grid, whichever is more, shape (n,) [N].
        at_edge: whether a decoder that saturates could keep the law with a prediction that does not, shape (n,).
        sector: of a deadband that keeps magnitude and direction apart; the ball then is the smallest that holds it.
    """

    force: Array
    position: Array
    tolerance: Array
    at_edge: Flags
    sector: Sector | None = None

    @property
    def ticks(self) -> int:
        return len(self.force)

    @property
    def used(self) -> NDArray[np.int64]:
        """The axes on which there is a force or a motion; at least one."""
        return axes_used(self.force, self.position)

    @property
    def collinear(self) -> bool:
        """Whether force and motion are on one axis, the same."""
        return len(self.used) == 1

    @property
    def magnitudes(self) -> tuple[Array, Array]:
        """Least and most magnitude that the law leaves, shape (n,) each [N]; below 0 where there may be no force."""
        size = lengths(self.force)
        if self.sector is None:
            return size - self.tolerance, size + self.tolerance
        return np.where(self.sector.least > 0.0, self.sector.least, -1.0), self.sector.most

    def first_broken(self, held: tuple[float, float, float] | None) -> int:
        """The first tick at which a decoder that holds a value breaks the law; n if none, 0 if it holds nothing."""
        if held is None:
            return 0
        broken = lengths(self.force - np.array(held)) > self.tolerance
        if self.sector is not None and held == ZERO:
            broken = self.sector.least > 0.0
        return int(broken.argmax()) if broken.any() else self.ticks


def bounded(deadband: Deadband) -> bool:
    """Whether what a deadband asks is a function of the signal alone, as it is where the measured force scales it."""
    if isinstance(deadband, ForceDeadband | VelocityDeadband):
        return deadband.reference == "actual"
    return isinstance(deadband, ConeDeadband | LevelCrossingDeadband)


def demand_of(force: Array, position: Array, channel: Channel) -> Demand:
    """What a force channel's encoder asks; its deadband must be `bounded`.

    An error that the sample's own quantization would not make smaller is not sent.

    Args:
        force: measured, shape (n, 3) [N], finite.
        position: commanded, shape (n, 3) [m], finite.
        channel: for its wire and its deadband.
    """
    wire = channel.value_quantizer
    seen = _confined(force, wire)
    place = position if channel.position_quantizer is None else _confined(position, channel.position_quantizer)
    grid_error = lengths(_confined(np.rint(seen / wire.step) * wire.step, wire) - seen)
    deadband, sector = channel.deadband, None
    if isinstance(deadband, ConeDeadband | LevelCrossingDeadband):
        forces = [(x, y, z) for x, y, z in seen.tolist()]
        sector = sector_of(deadband, forces, wire, collinear=len(axes_used(seen, place)) == 1)
        law = sector.radius
    else:
        law = np.maximum(_ball(deadband, lengths(seen), position), grid_error)
    tolerance = (1.0 + ROUNDING) * law + LEAST_ROUNDING * np.abs(seen).max(initial=0.0)
    at_edge = (np.abs(seen) + tolerance[:, None] >= wire.limit).any(axis=1)
    return Demand(seen, place, tolerance, at_edge, sector)


def axes_used(force: Array, position: Array) -> NDArray[np.int64]:
    """On which there is a force or a motion; at least one."""
    used = (force != 0.0).any(axis=0) | (position != position[0]).any(axis=0)
    return np.flatnonzero(used) if used.any() else np.array([0])


def _ball(deadband: Deadband, size: Array, position: Array) -> Array:
    """Radius of the deadband around forces of these magnitudes."""
    if isinstance(deadband, VelocityDeadband):
        moved = np.concatenate(([0.0], lengths(np.diff(position, axis=0))))
        weber = np.minimum(deadband.weber + deadband.per_metre * moved, deadband.highest)
        return np.maximum(weber * size, deadband.floor)
    assert isinstance(deadband, ForceDeadband)
    return np.maximum(deadband.weber * size, deadband.floor)


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
