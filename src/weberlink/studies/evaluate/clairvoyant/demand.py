"""The condition of the deadband on a decoded force at every tick.

A deadband with separate magnitude and direction leaves a piece of a shell, a `Sector`. Every region is slightly larger
than what the encoder accepts, by `ROUNDING`, and never smaller.
"""

from dataclasses import dataclass
from math import asin, inf, pi

import numpy as np
from numpy.typing import NDArray

from weberlink.codec import Channel
from weberlink.codec.deadband import ConeDeadband, Deadband, ForceDeadband, LevelCrossingDeadband, VelocityDeadband
from weberlink.codec.deadband.level_crossing import level_after, level_below
from weberlink.codec.quantizer import Quantizer
from weberlink.geometry.vector import ZERO, Vector, norm

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

ROUNDING = 1e-9
"""Relative widening of a region: the encoder rounds differently, and the bound must not exceed its sends."""
LEAST_ROUNDING = 1e-12
"""The same as a share of the largest force, for the rounding of an extrapolation."""


@dataclass(frozen=True)
class Sector:
    """The allowed regions of all ticks: least <= |g| <= most and (angle(g, f) <= angle or |g - f| <= near).

    Cone: magnitudes within max(k |f|, floor), its angle, and the floor as `near`. Level crossing: magnitudes from the
    next level below |f| less the hysteresis to the next above |f| plus the hysteresis. All arrays have shape (n,).

    Args:
        least: smallest magnitude [N]; 0 where the force may vanish.
        most: largest magnitude [N].
        angle: largest angle to the measured force [rad]; pi for any direction.
        near: radius of the ball in which any angle is allowed [N].
        beside: the largest angle in that ball [rad].
        radius: of the smallest ball around the measured force that contains the region [N].
    """

    least: Array
    most: Array
    angle: Array
    near: Array
    beside: Array
    radius: Array

    def extent(self, along: Array, size: Array) -> Array:
        """The largest projection of the region on unit vectors.

        Args:
            along: projection of the measured force on each vector, shape (directions, n) [N].
            size: its magnitude, shape (n,) [N].
        """
        known = np.where(size > 0.0, size, 1.0)
        cosine = np.clip(np.where(size > 0.0, along / known, 1.0), -1.0, 1.0)
        between = np.arccos(cosine)
        near = np.minimum(along + self.near, self._shell(between, self.beside))
        widest: Array = np.maximum(self._shell(between, self.angle), near)
        return widest

    def _shell(self, between: Array, angle: Array) -> Array:
        """Largest projection of a piece of shell with half-angle `angle` on vectors at `between` from its axis."""
        facing = np.cos(np.maximum(between - angle - ROUNDING, 0.0))
        shell: Array = np.where(facing > 0.0, self.most, self.least) * facing + ROUNDING * self.most
        return shell

    def directions(self, size: Array, slack: float) -> Array:
        """The largest angle to forces of these magnitudes [N], with an error of `slack` [N]; shape (n,)."""
        known = np.where(size > 0.0, size, 1.0)
        blurred = np.where(size > slack, np.arcsin(np.minimum(2.0 * slack / known, 1.0)), pi)
        angles: Array = np.minimum(np.maximum(self.angle, self.beside) + blurred, pi)
        return angles


def sector_of(
    deadband: ConeDeadband | LevelCrossingDeadband, forces: list[Vector], wire: Quantizer, *, collinear: bool
) -> Sector:
    """The regions around forces.

    Args:
        deadband: of the encoder.
        forces: confined to the axes and range of the wire [N].
        wire: where its grid is coarser than the deadband, the error of the grid is allowed.
        collinear: whether forces stay on one line; a region then has no width, except for the opposite direction.
    """
    rows = [_region(deadband, force, wire) for force in forces]
    least, most, angle, near = (np.array(column) for column in zip(*rows, strict=True))
    size = np.array([norm(force) for force in forces])
    beside = np.where(size > near, np.arcsin(np.minimum(near / np.where(size > 0.0, size, 1.0), 1.0)) + ROUNDING, pi)
    if collinear:
        angle, beside = np.where(angle < pi, 0.0, angle), np.where(beside < pi, 0.0, beside)
    # The farthest point lies on the rim, at the least or the largest magnitude.
    rim = [np.sqrt(np.maximum(size**2 + end**2 - 2.0 * size * end * np.cos(angle), 0.0)) for end in (least, most)]
    radius = np.maximum.reduce([*rim, near, most - size]) * (1.0 + ROUNDING)
    return Sector(least, most, angle, near, beside, radius)


def _region(
    deadband: ConeDeadband | LevelCrossingDeadband, force: Vector, wire: Quantizer
) -> tuple[float, float, float, float]:
    """Least and largest magnitude, angle, and radius of the small ball."""
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
    """Angle of two unit vectors with this distance, rounded up."""
    wider = chord * (1.0 + ROUNDING)
    return 2.0 * asin(0.5 * wider) + ROUNDING if wider < 2.0 else pi


@dataclass(frozen=True)
class Demand:
    """A decoded force must lie within `tolerance` of `force`, and in the sector if there is one.

    Args:
        force: confined to the axes and range of the wire, shape (n, 3) [N].
        position: where the decoder evaluates a model, shape (n, 3) [m].
        tolerance: the deadband or the error of the wire's grid, whichever is larger, shape (n,) [N].
        at_edge: whether saturation in the decoder can bring a wrong prediction into the deadband, shape (n,).
        sector: of a deadband with separate magnitude and direction; the ball then is the smallest that contains it.
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
        """The axes with force or motion; at least one."""
        return axes_used(self.force, self.position)

    @property
    def collinear(self) -> bool:
        """Whether all force and motion is on one axis."""
        return len(self.used) == 1

    @property
    def magnitudes(self) -> tuple[Array, Array]:
        """Least and largest allowed magnitude, shape (n,) each [N]; below 0 where the force may vanish."""
        size = lengths(self.force)
        if self.sector is None:
            return size - self.tolerance, size + self.tolerance
        return np.where(self.sector.least > 0.0, self.sector.least, -1.0), self.sector.most

    def first_broken(self, held: tuple[float, float, float] | None) -> int:
        """The first tick at which a held value leaves the deadband; n if none, 0 if nothing is held."""
        if held is None:
            return 0
        broken = lengths(self.force - np.array(held)) > self.tolerance
        if self.sector is not None and held == ZERO:
            broken = self.sector.least > 0.0
        return int(broken.argmax()) if broken.any() else self.ticks


def bounded(deadband: Deadband) -> bool:
    """Whether the deadband depends on the signal alone, and not on what was sent or displayed."""
    if isinstance(deadband, ForceDeadband | VelocityDeadband):
        return deadband.reference == "actual"
    return isinstance(deadband, ConeDeadband | LevelCrossingDeadband)


def demand_of(force: Array, position: Array, channel: Channel) -> Demand:
    """The condition of a force channel on finite forces [N] and positions [m]; its deadband must be `bounded`.

    The encoder does not send an error that the quantized sample would not reduce.
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
    """The axes with force or motion; at least one."""
    used = (force != 0.0).any(axis=0) | (position != position[0]).any(axis=0)
    return np.flatnonzero(used) if used.any() else np.array([0])


def _ball(deadband: Deadband, size: Array, position: Array) -> Array:
    """Radius of the deadband around forces of these magnitudes [N]."""
    if isinstance(deadband, VelocityDeadband):
        moved = np.concatenate(([0.0], lengths(np.diff(position, axis=0))))
        weber = np.minimum(deadband.weber + deadband.per_metre * moved, deadband.highest)
        return np.maximum(weber * size, deadband.floor)
    assert isinstance(deadband, ForceDeadband)
    return np.maximum(deadband.weber * size, deadband.floor)


def lengths(vectors: Array) -> Array:
    """Length of each row."""
    x, y, z = vectors.T
    total: Array = np.sqrt(x * x + y * y + z * z)
    return total


def _confined(values: Array, wire: Quantizer) -> Array:
    """As `Quantizer.confine`, for all ticks; infinity is confined to the corners of the range."""
    confined: Array = np.clip(values, wire.confine((-inf, -inf, -inf)), wire.confine((inf, inf, inf)))
    return confined
