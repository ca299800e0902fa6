"""What the three driven bodies move: the interface of a linkage, and the serial one with its parallelogram; pure.

The frame is that of the device: x towards the operator, y to the right, z up, in metres from the middle of the
workspace.
"""

from dataclasses import dataclass
from math import acos, atan2, cos, hypot, pi, sin
from typing import Protocol

from weberlink.geometry.vector import Vector
from weberlink.master.devices.polhem.drive import Angles

Jacobian = tuple[Vector, Vector, Vector]
"""Rows x, y, z; columns A, B, C [m/rad]."""


class Linkage(Protocol):
    """Where the tip is for the angles of the bodies, and back. Everything is finite for every angle."""

    def position(self, angles: Angles) -> Vector: ...

    def jacobian(self, angles: Angles) -> Jacobian: ...

    def inverse(self, position: Vector) -> Angles:
        """The angles of the pose in which the device is used, or the nearest for a position out of reach."""
        ...

    def forearm(self, angles: Angles) -> float:
        """Elevation of the last link over the horizontal [rad]."""
        ...


@dataclass(frozen=True)
class SerialParallelogram:
    """Body A turns all about the vertical; B is the upper arm, and C turns the forearm by a parallelogram.

    B and C are absolute angles from the vertical, so the upper arm does not turn the forearm:

        r = lb sin B + lc sin C,   x = r cos A - ox,   y = r sin A - oy,   z = ln + lb cos B - lc cos C - oz

    Args:
        ln: height of the shoulder [m].
        lb: length of the upper arm [m].
        lc: length of the forearm [m].
        origin: middle of the workspace from the foot of the vertical axis [m].
    """

    ln: float
    lb: float
    lc: float
    origin: Vector

    def position(self, angles: Angles) -> Vector:
        a, b, c = angles
        r = self.lb * sin(b) + self.lc * sin(c)
        ox, oy, oz = self.origin
        return (r * cos(a) - ox, r * sin(a) - oy, self.ln + self.lb * cos(b) - self.lc * cos(c) - oz)

    def jacobian(self, angles: Angles) -> Jacobian:
        a, b, c = angles
        sin_a, cos_a, sin_b, sin_c = sin(a), cos(a), sin(b), sin(c)
        r = self.lb * sin_b + self.lc * sin_c
        forth_b, forth_c = self.lb * cos(b), self.lc * cos(c)
        return (
            (-sin_a * r, cos_a * forth_b, cos_a * forth_c),
            (cos_a * r, sin_a * forth_b, sin_a * forth_c),
            (0.0, -self.lb * sin_b, self.lc * sin_c),
        )

    def inverse(self, position: Vector) -> Angles:
        """The elbow is up, and the tip before the vertical axis."""
        x, y, z = (p + o for p, o in zip(position, self.origin, strict=True))
        up = z - self.ln
        forth = hypot(x, y)
        reach = max(hypot(forth, up), 1e-9)
        elevation = atan2(forth, up)  # from the vertical
        b = elevation - acos_clamped((self.lb**2 + reach**2 - self.lc**2) / (2.0 * self.lb * reach))
        c = elevation + acos_clamped((self.lc**2 + reach**2 - self.lb**2) / (2.0 * self.lc * reach))
        return (atan2(y, x), b, pi - c)

    def forearm(self, angles: Angles) -> float:
        return angles[2] - 0.5 * pi


def acos_clamped(cosine: float) -> float:
    """The angle; 0 or pi for what is no cosine any more, since the links do not reach."""
    return acos(min(1.0, max(-1.0, cosine)))
