"""The normal of a contact with friction, told from the direction of sliding.

Friction tilts the force against the sliding. The part of the force that is perpendicular to the sliding is normal to
the surface, whatever the friction coefficient.
"""

from math import hypot

from weberlink.geometry.vector import ZERO, Vector

AVERAGED = 1e-3
"""Way along a surface over which the direction of sliding is averaged [m]."""
LEAST_WAY = 1e-4
"""Shortest averaged way that has a direction [m]; less may be noise."""
LEAST_NORMAL = 0.5
"""Least square of the normal part of a force, as a share of the whole: friction below 1. With less it is no sliding."""


class Sliding:
    """The direction of sliding of a contact.

    It follows the point x + F / K of a probe at x that touches with a force F and a stiffness K. Pressing does not move
    this point, sliding moves it along the surface.
    """

    __slots__ = ("_slid",)

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._slid: Vector = ZERO

    def move(self, way: Vector, change: Vector, stiffness: float) -> None:
        """Take in a step [m] of a probe in contact, and the change of the force on it [N]."""
        compliance, slid = 1.0 / stiffness, self._slid
        x, y, z = way[0] + compliance * change[0], way[1] + compliance * change[1], way[2] + compliance * change[2]
        kept = max(0.0, 1.0 - hypot(x, y, z) / AVERAGED)
        self._slid = (kept * slid[0] + x, kept * slid[1] + y, kept * slid[2] + z)

    def normal_part(self, force: Vector) -> Vector:
        """The part of a contact force [N] that is normal to the surface; all of it where nothing slides."""
        slid = self._slid
        squared = slid[0] * slid[0] + slid[1] * slid[1] + slid[2] * slid[2]
        if squared < LEAST_WAY * LEAST_WAY:
            return force
        share = (force[0] * slid[0] + force[1] * slid[1] + force[2] * slid[2]) / squared
        x, y, z = force[0] - share * slid[0], force[1] - share * slid[1], force[2] - share * slid[2]
        whole = force[0] * force[0] + force[1] * force[1] + force[2] * force[2]
        return (x, y, z) if x * x + y * y + z * z >= LEAST_NORMAL * whole else force
