"""A mixture of received contact models, faded into one another without making energy.

Every model is an elastic wall at rest. One that would press harder than the energy allows is displayed recessed: deeper
by a distance, with its own stiffness, and it comes up as energy allows. A mixture with fixed weights and recesses is
conservative; only a change of it makes or takes energy, and the amount is known before the change.
"""

from math import hypot, sqrt

from weberlink.control.contract import WallModel
from weberlink.geometry.vector import Vector

MOST_SURFACES = 6
"""Surfaces in a mixture; of more the lightest is dropped, which only takes energy."""
LEAST_WEIGHT = 0.01
RISE_SPEED = 0.1
"""How fast a recessed surface comes up [m/s]."""
SPENT_AT_ONCE = 0.1
"""Part of the energy to spare that a surface may take in one tick by coming up."""


class RecessedSurface:
    """A surface in the mixture, with its weight and how much deeper than received it lies."""

    __slots__ = ("recess", "surface", "weight")

    def __init__(self, surface: WallModel, recess: float) -> None:
        self.surface = surface
        self.recess = recess
        self.weight = 0.0

    def at(self, position: Vector) -> tuple[Vector, float]:
        """Force [N] and stored energy [J] at a position [m], not weighted."""
        force = self.surface.at(0.0, position)
        length = hypot(force[0], force[1], force[2])
        pressed = length - self.recess * self.surface.stiffness
        if pressed <= 0.0:
            return (0.0, 0.0, 0.0), 0.0
        share = pressed / length
        stored = 0.5 * pressed * pressed / self.surface.stiffness
        return (share * force[0], share * force[1], share * force[2]), stored

    def come_up(self, position: Vector, elapsed: float, spare: float) -> None:
        """Lessen the recess: as far as the hand at once, and against it as fast as energy allows."""
        if self.recess == 0.0:
            return
        force = self.surface.at(0.0, position)
        stiffness = self.surface.stiffness
        depth = hypot(force[0], force[1], force[2]) / stiffness
        self.recess = min(self.recess, depth)  # up to a hand that it does not touch
        pressed = depth - self.recess
        affordable = SPENT_AT_ONCE * max(0.0, spare)
        rise = sqrt(pressed * pressed + 2.0 * affordable / stiffness) - pressed
        self.recess = max(0.0, self.recess - min(rise, RISE_SPEED * elapsed))


class SurfaceMixture:
    """Weighted surfaces, of which the newest is wanted and the others are on their way out."""

    __slots__ = ("_parts", "_wanted")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._parts: list[RecessedSurface] = []
        self._wanted: RecessedSurface | None = None

    @property
    def wanted(self) -> WallModel | None:
        """The surface that the mixture turns into; None for free space."""
        return None if self._wanted is None else self._wanted.surface

    def want(self, surface: WallModel | None, position: Vector) -> None:
        """Begin to turn into this surface, recessed so that it presses no harder on the hand than the mixture does."""
        if surface is None:
            self._wanted = None
            return
        felt, _ = self.at(position)
        force = surface.at(0.0, position)
        excess = hypot(force[0], force[1], force[2]) - hypot(felt[0], felt[1], felt[2])
        self._wanted = RecessedSurface(surface, max(0.0, excess) / surface.stiffness)
        self._parts = [*sorted(self._parts, key=_weight)[1 - MOST_SURFACES :], self._wanted]

    def at(self, position: Vector) -> tuple[Vector, float]:
        """Force [N] and stored energy [J] at a position [m]."""
        x = y = z = stored = 0.0
        for part in self._parts:
            force, energy = part.at(position)
            weight = part.weight
            x, y, z = x + weight * force[0], y + weight * force[1], z + weight * force[2]
            stored += weight * energy
        return (x, y, z), stored

    def turn(self, share: float, position: Vector, elapsed: float, spare: float) -> None:
        """Move weight to the wanted surface, and let it come up.

        Args:
            share: of the weight that may move now, 0..1.
            position: where the operator is [m].
            elapsed: since the last call [s].
            spare: energy that the change may put into the model [J].
        """
        wanted = self._wanted
        if wanted is None:
            self._fade(list(self._parts), 1.0 - share)
            return
        others = [part for part in self._parts if part is not wanted]
        moved = min(share, 1.0 - wanted.weight)
        if moved > 0.0:
            spare -= self._move(wanted, others, moved, position, spare)
        wanted.come_up(position, elapsed, spare)

    def _move(
        self, wanted: RecessedSurface, others: list[RecessedSurface], moved: float, position: Vector, spare: float
    ) -> float:
        """Give it so much weight, or as much as can be paid for; returns what that costs [J].

        The others lose what the sum of 1 has no room for, and more, up to as much, where that is needed to pay for it.
        """
        spare = max(0.0, spare)
        of_others = sum(part.weight for part in others)
        price = moved * wanted.at(position)[1]
        lost = max(0.0, wanted.weight + of_others + moved - 1.0)
        freed = sum(part.weight * part.at(position)[1] for part in others) / of_others if of_others > 0.0 else 0.0
        if price - lost * freed > spare and freed > 0.0:
            lost = max(lost, min(moved, of_others, (price - spare) / freed))
        price -= lost * freed
        if price > spare:
            moved, lost, price = (spare / price * amount for amount in (moved, lost, price))
        if of_others > 0.0:
            self._fade(others, max(0.0, 1.0 - lost / of_others))
        wanted.weight += moved
        return price

    def _fade(self, parts: list[RecessedSurface], share: float) -> None:
        """Leave them this share of their weights; one whose weight no longer counts is gone."""
        for part in parts:
            part.weight *= share
        self._parts = [part for part in self._parts if part.weight >= LEAST_WEIGHT or part is self._wanted]


def _weight(part: RecessedSurface) -> float:
    return part.weight
