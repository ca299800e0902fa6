"""A contact surface with the edges beyond which the robot found free space.

A received model describes the surface near its newest sample, and does not tell where the surface ends. So a sample
without force, at a place where the surface should press, is taken as an edge: the surface ends there, across the way
from the place where it was found. The rest of it stays known, and is felt at once when the hand comes back to it.
"""

from weberlink.control.contract import WallModel
from weberlink.geometry.vector import Vector, dot, norm, scale, subtract, unit

LEAST_EXTENT = 2e-3
"""A surface that ends nearer to the place where it was found is gone [m]."""
MARGIN = 5e-4
"""A hand beyond an edge must come back by as much to touch the surface again [m]."""
MOST_EDGES = 8
"""Largest number of edges of a surface; beyond it, the oldest is forgotten."""


class KnownSurface:
    """A surface, and the place at which it was found [m].

    Attributes:
        surface: the received model.
        covers: whether the hand was within all edges at the last `follow`.
    """

    __slots__ = ("_edges", "_place", "covers", "surface")

    def __init__(self, surface: WallModel, place: Vector) -> None:
        self.surface = surface
        self._place = place
        self._edges: list[tuple[Vector, float]] = []
        self.covers = True

    def renew(self, surface: WallModel, place: Vector) -> None:
        """Take in a newer model of the surface; edges that do not have this place [m] within them are forgotten."""
        self.surface, self._place = surface, place
        self.reach(place)

    def follow(self, position: Vector) -> None:
        """Take in the position of the hand [m]."""
        self.covers = self._has(position, 0.0 if self.covers else MARGIN)

    def has(self, position: Vector) -> bool:
        """Whether a position [m] is within all edges."""
        return self._has(position, 0.0)

    def _has(self, position: Vector, margin: float) -> bool:
        return all(dot(outward, position) < offset - margin for outward, offset in self._edges)

    def reach(self, position: Vector) -> None:
        """Take in that the surface is there [m]."""
        self._edges = [edge for edge in self._edges if dot(edge[0], position) < edge[1]]

    def end(self, position: Vector, normal: Vector) -> bool:
        """Take in that the surface ends before a position.

        Args:
            position: where the surface should press and does not [m].
            normal: of the surface there, of any length, not zero.

        Returns:
            Whether there is a surface left.
        """
        way, normal = subtract(position, self._place), unit(normal)
        along = subtract(way, scale(normal, dot(way, normal)))
        if norm(along) < LEAST_EXTENT:
            return False
        outward = unit(along)
        self._edges = [*self._edges[1 - MOST_EDGES :], (outward, dot(outward, position))]
        return True
