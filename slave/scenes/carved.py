"""A solid with hollows cut out of it, such as a bowl in a table."""

from collections.abc import Sequence

from weberlink.geometry.vector import Vector
from weberlink.slave.scenes.shape import Shape, Tangent


class Carved:
    """What is left of `base` where every one of `cavities` is solid as well: phi = max(phi_base, phi_cavity, ...).

    A cavity is a shape that is solid outside (`SphereCavity`, `BoxCavity`, a `Plane` that faces the other way), so
    this is phi = max(phi_base, -phi_cut). The largest distance is never more than the true one, and its surface is
    the one that holds the proxy: where two of them cross, the edge is convex, and a point inside always has one of
    the two to lean on.
    """

    __slots__ = ("_parts",)

    flat = False

    def __init__(self, base: Shape, cavities: Sequence[Shape]) -> None:
        self._parts: tuple[Shape, ...] = (base, *cavities)

    def clearance(self, point: Vector) -> float:
        largest = self._parts[0].clearance(point)
        for part in self._parts[1:]:
            largest = max(largest, part.clearance(point))
        return largest

    def linearise(self, point: Vector) -> tuple[Tangent, ...]:
        holding = self._parts[0]
        largest = holding.clearance(point)
        for part in self._parts[1:]:
            clearance = part.clearance(point)
            if clearance > largest:
                largest, holding = clearance, part
        return holding.linearise(point)
