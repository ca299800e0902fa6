"""What a solid must answer for the proxy to slide on it; knows nothing of stiffness, friction or other solids."""

from typing import Protocol

from weberlink.geometry.vector import Vector

Tangent = tuple[float, Vector]
"""Signed distance [m] from a point to a surface near it (negative inside the solid), and the outward unit normal."""


class Shape(Protocol):
    """A rigid solid in the scene frame. Both methods accept any finite point and never raise."""

    @property
    def flat(self) -> bool:
        """True where one linearisation is exact everywhere, so that the proxy needs no second look."""
        ...

    def clearance(self, point: Vector) -> float:
        """At most the distance [m] from `point` to the solid; negative inside.

        A ball of this radius around the point is certainly free, which is what lets the proxy be traced along a path in
        safe steps (Hart 1996, sphere tracing).
        """
        ...

    def linearise(self, point: Vector) -> tuple[Tangent, ...]:
        """The surface seen from `point` as tangent planes, to first order.

        One plane on a smooth surface or a convex edge; several where faces meet in a concave corner, since there the
        point is held by all of them at once.
        """
        ...
