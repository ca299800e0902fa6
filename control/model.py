"""The model that the operator feels: received surfaces, faded into one another without making energy.

Every surface is an elastic wall at rest, so a mixture of walls with fixed weights is conservative, and stores the
weighted sum of what its members store. Only a change of weights makes or takes energy, and how much is known before it
is made.
"""

from control.contract import Surface, Vector

MOST_SURFACES = 6
"""Surfaces in a mixture; of more the lightest is dropped, which only takes energy."""
LEAST_WEIGHT = 0.01


class SurfaceMixture:
    """Weighted surfaces, of which the newest is wanted and the others are on their way out."""

    __slots__ = ("_parts", "_wanted")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._parts: list[tuple[Surface, float]] = []
        self._wanted: Surface | None = None

    @property
    def wanted(self) -> Surface | None:
        """The surface that the mixture turns into; None for free space."""
        return self._wanted

    def want(self, surface: Surface | None) -> None:
        """Begin to turn into this surface."""
        self._wanted = surface

    def at(self, position: Vector) -> tuple[Vector, float]:
        """Force [N] and stored energy [J] at a position [m]."""
        x = y = z = stored = 0.0
        for surface, weight in self._parts:
            force = surface.at(0.0, position)
            x, y, z = x + weight * force[0], y + weight * force[1], z + weight * force[2]
            stored += weight * energy(surface, force)
        return (x, y, z), stored

    def turn(self, share: float, position: Vector, spare: float) -> None:
        """Move weight to the wanted surface.

        Args:
            share: of the weight that may move now, 0..1.
            position: where the operator is [m].
            spare: energy that the change may put into the model [J].
        """
        wanted = self._wanted
        if wanted is None:
            self._parts = _kept(self._parts, 1.0 - share)
            return
        others = [(surface, weight) for surface, weight in self._parts if surface != wanted]
        weight_of_others = sum(weight for _, weight in others)
        mine = sum(weight for surface, weight in self._parts if surface == wanted)
        moved = min(share, 1.0 - mine)
        if moved <= 0.0:
            return
        price = energy(wanted, wanted.at(0.0, position))
        if moved <= weight_of_others:  # what they lose pays for what it gains
            freed = sum(weight * energy(surface, surface.at(0.0, position)) for surface, weight in others)
            price -= freed / weight_of_others
        if price * moved > spare:
            moved = max(0.0, spare) / price
        left = max(0.0, 1.0 - moved / weight_of_others) if others else 0.0
        self._parts = [*_kept(others, left)[1 - MOST_SURFACES :], (wanted, mine + moved)]


def energy(surface: Surface, force: Vector) -> float:
    """What the surface stores where it gives this force [J]."""
    return 0.5 * (force[0] * force[0] + force[1] * force[1] + force[2] * force[2]) / surface.stiffness


def _kept(parts: list[tuple[Surface, float]], share: float) -> list[tuple[Surface, float]]:
    """The parts with a share of their weights; a weight that no longer counts is gone."""
    return [(surface, weight * share) for surface, weight in parts if weight * share >= LEAST_WEIGHT]
