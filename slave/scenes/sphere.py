"""The settings of a ball, or its complement."""

from typing import Literal

from pydantic import Field

from weberlink.geometry.vector import Vector
from weberlink.slave.scenes.shape import CarvableSettings, Shape
from weberlink.slave.scenes.solids import SphereShape


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
