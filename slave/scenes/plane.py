"""The settings of a half-space."""

from typing import Literal

from pydantic import Field

from weberlink.geometry.vector import Vector
from weberlink.slave.scenes.shape import CarvableSettings, Shape, UnitVector
from weberlink.slave.scenes.solids import PlaneShape


class PlaneSettings(CarvableSettings):
    """A half-space, solid against the normal."""

    shape: Literal["plane"]
    point_m: Vector = (0.0, 0.0, 0.0)
    normal: UnitVector = Field(default=(0.0, 0.0, 1.0), description="outward, of any length; it is normalised")

    def solid(self) -> Shape:
        return PlaneShape(self.point_m, self.normal)

    def hollow(self) -> Shape:
        return PlaneShape(self.point_m, (-self.normal[0], -self.normal[1], -self.normal[2]))
