"""What a deadband that keeps magnitude and direction apart leaves to a decoder: a piece of a shell.

Owns that region for the shapes of that kind, and its extent in a direction. A region is a little larger than what the
encoder accepts, by `ROUNDING`, and never smaller: around a force of magnitude m it is

    least <= |g| <= most and (angle(g, f) <= angle or |g - f| <= near).

- Cone: m -+ max(k m, floor), its angle, and the floor as `near`.
- Level crossing: from the level that is next below m less the hysteresis to the one that is next above m with it.

Where the wire's own grid is coarser than the deadband, what the encoder asks of the sample's own quantization is
what is asked here: magnitude and angle grow alike.
"""

from dataclasses import dataclass
from math import asin, inf, pi

import numpy as np
from numpy.typing import NDArray

from weberlink.codec.deadband import ConeDeadband, LevelCrossingDeadband
from weberlink.codec.deadband.level_crossing import level_after, level_below
from weberlink.codec.quantizer import Quantizer
from weberlink.geometry.vector import ZERO, Vector, norm

Array = NDArray[np.float64]

ROUNDING = 1e-9
"""Share by which a region is widened: the encoder's arithmetic is not ours, and the bound must not be above it."""


@dataclass(frozen=True)
class Sector:
    """The regions of all ticks, each array of shape (n,).

    Args:
        least: smallest magnitude [N]; 0 where there may be no force.
        most: largest magnitude [N].
        angle: largest angle to the measured force [rad]; pi for any direction.
        near: radius of the ball in which every angle is left [N].
        beside: the largest angle there is in that ball [rad].
        radius: of the smallest ball around the measured force that holds it all [N].
    """

    least: Array
    most: Array
    angle: Array
    near: Array
    beside: Array
    radius: Array

    def extent(self, along: Array, size: Array) -> Array:
        """The largest projection on unit vectors, of the two parts by themselves.

        Args:
            along: projection of the measured force on each of them, shape (directions, n) [N].
            size: its magnitude, shape (n,) [N].
        """
        known = np.where(size > 0.0, size, 1.0)
        cosine = np.clip(np.where(size > 0.0, along / known, 1.0), -1.0, 1.0)
        between = np.arccos(cosine)
        near = np.minimum(along + self.near, self._shell(between, self.beside))
        widest: Array = np.maximum(self._shell(between, self.angle), near)
        return widest

    def _shell(self, between: Array, angle: Array) -> Array:
        """Of a piece of shell with that half-angle, on vectors at other angles from its axis."""
        facing = np.cos(np.maximum(between - angle - ROUNDING, 0.0))
        shell: Array = np.where(facing > 0.0, self.most, self.least) * facing + ROUNDING * self.most
        return shell

    def directions(self, size: Array, slack: float) -> Array:
        """The largest angle to forces of these magnitudes [N], for a force that is off by `slack` [N]; shape (n,)."""
        known = np.where(size > 0.0, size, 1.0)
        blurred = np.where(size > slack, np.arcsin(np.minimum(2.0 * slack / known, 1.0)), pi)
        angles: Array = np.minimum(np.maximum(self.angle, self.beside) + blurred, pi)
        return angles


def sector_of(
    deadband: ConeDeadband | LevelCrossingDeadband, forces: list[Vector], wire: Quantizer, *, collinear: bool
) -> Sector:
    """The regions around forces as the encoder sees them.

    Args:
        deadband: what the encoder asks.
        forces: confined to the wire's axes and range [N].
        wire: where its own grid is coarser than the deadband, that is what is asked.
        collinear: whether nothing can be said that is beside one line; a region then has no width, but for the opposite
            direction where any is allowed.
    """
    rows = [_region(deadband, force, wire) for force in forces]
    least, most, angle, near = (np.array(column) for column in zip(*rows, strict=True))
    size = np.array([norm(force) for force in forces])
    beside = np.where(size > near, np.arcsin(np.minimum(near / np.where(size > 0.0, size, 1.0), 1.0)) + ROUNDING, pi)
    if collinear:
        angle, beside = np.where(angle < pi, 0.0, angle), np.where(beside < pi, 0.0, beside)
    # The farthest point is on the rim, at one end of the magnitudes or the other.
    rim = [np.sqrt(np.maximum(size**2 + end**2 - 2.0 * size * end * np.cos(angle), 0.0)) for end in (least, most)]
    radius = np.maximum.reduce([*rim, near, most - size]) * (1.0 + ROUNDING)
    return Sector(least, most, angle, near, beside, radius)


def _region(
    deadband: ConeDeadband | LevelCrossingDeadband, force: Vector, wire: Quantizer
) -> tuple[float, float, float, float]:
    """Least and most magnitude, angle, and radius of the small ball."""
    size = norm(force)
    law = max(deadband.bound(force, ZERO, ZERO, 0.0), deadband.error(wire.rounded(force), force)) * (1.0 + ROUNDING)
    if isinstance(deadband, ConeDeadband):
        least, most = max(size - law, 0.0), size + law
        unit = max(deadband.weber * size, deadband.floor)
        turned = law / unit if unit > 0.0 else inf
    else:
        least, most = _between_levels(deadband, size, law)
        turned = max(1.0, law / max(deadband.spacing * size, deadband.floor))
    angle = _angle_of(deadband.widest * turned) if size > 0.0 else pi
    return least * (1.0 - ROUNDING), most * (1.0 + ROUNDING), angle, deadband.floor * (1.0 + ROUNDING)


def _between_levels(deadband: LevelCrossingDeadband, size: float, law: float) -> tuple[float, float]:
    grid = deadband.floor, deadband.knee, deadband.powers
    below = level_below((size - law) * (1.0 - ROUNDING), *grid)
    return below, level_after(level_below((size + law) * (1.0 + ROUNDING), *grid), *grid)


def _angle_of(chord: float) -> float:
    """Of two unit vectors so far apart, or a little more."""
    wider = chord * (1.0 + ROUNDING)
    return 2.0 * asin(0.5 * wider) + ROUNDING if wider < 2.0 else pi
