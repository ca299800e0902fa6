"""A half-space."""

from typing import Literal

from pydantic import Field

from weberlink.geometry.vector import Vector, dot, norm, scale
from weberlink.slave.scenes.shape import CarvableSettings, Shape, Tangent, UnitVector


class PlaneShape:
    """Solid below the plane through `point` with the outward `normal` (any length above zero)."""

    __slots__ = ("_normal", "_offset")

    flat = True

    def __init__(self, point: Vector, normal: Vector) -> None:
        length = norm(normal)
        if not length > 0.0:
            raise ValueError(f"normal: expected a vector longer than zero, got {normal}")
        self._normal = scale(normal, 1.0 / length)
        self._offset = dot(self._normal, point)

    def clearance(self, point: Vector) -> float:
        normal = self._normal
        return normal[0] * point[0] + normal[1] * point[1] + normal[2] * point[2] - self._offset

    def linearise(self, point: Vector) -> tuple[Tangent, ...]:
        normal = self._normal
        return ((normal[0] * point[0] + normal[1] * point[1] + normal[2] * point[2] - self._offset, normal),)


class PlaneSettings(CarvableSettings):
    """A half-space, solid against the normal."""

    shape: Literal["plane"]
    point_m: Vector = (0.0, 0.0, 0.0)
    normal: UnitVector = Field(default=(0.0, 0.0, 1.0), description="outward, of any length; it is normalised")

    def solid(self) -> Shape:
        return PlaneShape(self.point_m, self.normal)

    def hollow(self) -> Shape:
        return PlaneShape(self.point_m, (-self.normal[0], -self.normal[1], -self.normal[2]))
