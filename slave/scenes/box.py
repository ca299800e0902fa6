"""The settings of a box with sharp edges, or its complement."""

from math import radians
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from weberlink.geometry.vector import Vector
from weberlink.slave.scenes.derived import TurnedShape
from weberlink.slave.scenes.shape import CarvableSettings, Shape
from weberlink.slave.scenes.solids import BoxCavity, BoxShape


def edges(size: Vector) -> Vector:
    if not min(size) > 0.0:
        raise ValueError("expected three edges longer than 0 m")
    return size


RollPitchYaw = Annotated[
    Vector, Field(description="roll, pitch, yaw [deg] about the centre: R = Rz(yaw) Ry(pitch) Rx(roll)")
]


class BoxSettings(CarvableSettings):
    """A box with sharp edges; with `side: inside`, everything but the box."""

    shape: Literal["box"]
    center_m: Vector
    size_m: Annotated[Vector, AfterValidator(edges)]
    side: Literal["outside", "inside"] = Field(default="outside", description="where the operator is")
    rotation_deg: RollPitchYaw | None = None

    def solid(self) -> Shape:
        return self._turned(BoxShape(self.center_m, self.size_m)) if self.side == "outside" else self.hollow()

    def hollow(self) -> Shape:
        return self._turned(BoxCavity(self.center_m, self.size_m))

    def _turned(self, shape: Shape) -> Shape:
        if self.rotation_deg is None:
            return shape
        roll, pitch, yaw = self.rotation_deg
        return TurnedShape(shape, self.center_m, (radians(roll), radians(pitch), radians(yaw)))
