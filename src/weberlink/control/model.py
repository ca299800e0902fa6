"""A mixture of received contact models that are faded into one another without creating energy.

Every model is an elastic wall at rest. A new wall that would press harder than the energy allows is displayed recessed:
at a greater depth, with its own stiffness. It rises as energy becomes available. A mixture with fixed weights and
recesses is conservative. Only a change of it creates or takes energy, and the amount is known before the change.
"""

from math import hypot, sqrt
from operator import attrgetter

from weberlink.control.contract import WallModel
from weberlink.geometry.vector import ZERO, Vector

MOST_SURFACES = 6
"""Largest number of surfaces in a mixture; beyond it, the one with the least weight is dropped, which takes energy."""
LEAST_WEIGHT = 0.01
"""A surface with a smaller weight is dropped."""
RISE_SPEED = 0.03
"""Largest speed at which a recessed surface rises [m/s]. It lifts the hand, which takes energy: a faster one loses more
of it in the damping of the hand, and stays recessed in the end."""
SPENT_AT_ONCE = 0.1
"""Largest energy that a rising surface may take in a tick, as a share of the spare energy."""


class RecessedSurface:
    """A surface in the mixture, with its weight (0 to 1) and its recess: the additional depth [m], >= 0."""

    __slots__ = ("recess", "surface", "weight")

    def __init__(self, surface: WallModel, recess: float) -> None:
        self.surface = surface
        self.recess = recess
        self.weight = 0.0

    def at(self, position: Vector) -> tuple[Vector, float]:
        """Force [N] and stored energy [J] at a position [m], without the weight."""
        force = self.surface.at(0.0, position)
        length = hypot(force[0], force[1], force[2])
        pressed = length - self.recess * self.surface.stiffness
        if pressed <= 0.0:
            return ZERO, 0.0
        share = pressed / length
        stored = 0.5 * pressed * pressed / self.surface.stiffness
        return (share * force[0], share * force[1], share * force[2]), stored

    def come_up(self, position: Vector, elapsed: float, spare: float) -> None:
        """Reduce the recess: up to the hand at once, and against the hand as fast as the spare energy [J] allows."""
        if self.recess == 0.0:
            return
        force = self.surface.at(0.0, position)
        stiffness = self.surface.stiffness
        depth = hypot(force[0], force[1], force[2]) / stiffness
        self.recess = min(self.recess, depth)  # free up to the hand
        pressed = depth - self.recess
        affordable = SPENT_AT_ONCE * max(0.0, spare)
        rise = sqrt(pressed * pressed + 2.0 * affordable / stiffness) - pressed
        self.recess = max(0.0, self.recess - min(rise, RISE_SPEED * elapsed))


class SurfaceMixture:
    """Weighted surfaces: the newest is the wanted one and fades in, the others fade out."""

    __slots__ = ("_parts", "_wanted")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._parts: list[RecessedSurface] = []
        self._wanted: RecessedSurface | None = None

    @property
    def wanted(self) -> WallModel | None:
        """The surface that the mixture changes to; None for free space."""
        return None if self._wanted is None else self._wanted.surface

    def want(self, surface: WallModel | None, position: Vector) -> None:
        """Begin to change to this surface, recessed so that it presses no harder on the hand than the mixture does.

        Args:
            surface: the new surface; None for free space.
            position: position of the hand [m].
        """
        if surface is None:
            self._wanted = None
            return
        felt, _ = self.at(position)
        force = surface.at(0.0, position)
        excess = hypot(force[0], force[1], force[2]) - hypot(felt[0], felt[1], felt[2])
        self._wanted = RecessedSurface(surface, max(0.0, excess) / surface.stiffness)
        self._parts = [*sorted(self._parts, key=attrgetter("weight"))[1 - MOST_SURFACES :], self._wanted]

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
        """Move weight to the wanted surface, and let it rise.

        Args:
            share: weight that may move now, 0 to 1.
            position: position of the hand [m].
            elapsed: time since the last call [s].
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
        """Move this weight to the wanted surface, or as much as the energy allows; returns the energy cost [J].

        The other surfaces lose weight so that the sum stays at most 1. They lose more, up to the weight that moves, if
        the energy that this frees is needed.
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
        """Multiply the weights of these surfaces by a share; drop a surface whose weight falls below `LEAST_WEIGHT`."""
        for part in parts:
            part.weight *= share
        self._parts = [part for part in self._parts if part.weight >= LEAST_WEIGHT or part is self._wanted]
