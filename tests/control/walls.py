"""Elastic surfaces at rest for the tests of control."""

from dataclasses import dataclass

from weberlink.geometry.vector import ZERO, Vector


@dataclass(frozen=True)
class Wall:
    """Solid below a height [m] on z."""

    stiffness: float = 500.0
    height: float = 0.0

    def at(self, tick: float, position: Vector) -> Vector:
        return (0.0, 0.0, max(0.0, self.stiffness * (self.height - position[2])))


@dataclass(frozen=True)
class Ball:
    """Solid within a radius [m] of a centre [m]."""

    stiffness: float = 500.0
    centre: Vector = (0.0, 0.0, -0.05)
    radius: float = 0.05

    def at(self, tick: float, position: Vector) -> Vector:
        x, y, z = (p - c for p, c in zip(position, self.centre, strict=True))
        length = (x * x + y * y + z * z) ** 0.5
        if length >= self.radius or length == 0.0:
            return ZERO
        share = self.stiffness * (self.radius - length) / length
        return (share * x, share * y, share * z)
