"""A ball, and its complement."""

from math import sqrt
from typing import Literal

from pydantic import Field

from weberlink.geometry.vector import Vector
from weberlink.slave.scenes.shape import CarvableSettings, Shape, Tangent


class SphereShape:
    """Solid within `radius` [m] of `center`; with `inside`, where the probe then is, solid everywhere else."""

    __slots__ = ("_radius", "_sign", "_x", "_y", "_z")

    flat = False

    def __init__(self, center: Vector, radius: float, *, inside: bool = False) -> None:
        if not radius > 0.0:
            raise ValueError(f"radius: expected more than 0 m, got {radius}")
        self._x, self._y, self._z = center
        self._radius = radius
        self._sign = -1.0 if inside else 1.0

    def clearance(self, point: Vector) -> float:
        x, y, z = point[0] - self._x, point[1] - self._y, point[2] - self._z
        return self._sign * (sqrt(x * x + y * y + z * z) - self._radius)

    def linearise(self, point: Vector) -> tuple[Tangent, ...]:
        x, y, z, sign = point[0] - self._x, point[1] - self._y, point[2] - self._z, self._sign
        length = sqrt(x * x + y * y + z * z)
        if length == 0.0:
            return ((-sign * self._radius, (0.0, 0.0, 1.0)),)  # all directions are equal here
        signed = sign * length
        return ((sign * (length - self._radius), (x / signed, y / signed, z / signed)),)


class SphereSettings(CarvableSettings):
    """A ball; with `side: inside`, everything but the ball."""

    shape: Literal["sphere"]
    center_m: Vector
    radius_m: float = Field(gt=0.0)
    side: Literal["outside", "inside"] = Field(default="outside", description="where the operator is")

    def solid(self) -> Shape:
        return SphereShape(self.center_m, self.radius_m, inside=self.side == "inside")

    def hollow(self) -> Shape:
        return SphereShape(self.center_m, self.radius_m, inside=True)
