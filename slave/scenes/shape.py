"""What every shape provides: its geometry, its settings, and its entry in the table of shapes."""

from math import sqrt
from typing import Annotated, Protocol

from pydantic import AfterValidator

from weberlink.geometry.vector import Vector
from weberlink.options import Options
from weberlink.registry import Registry, check_overrides

Tangent = tuple[float, Vector]
"""Signed distance [m] from a point to a surface near it (negative inside the solid), and the outward unit normal."""


class Shape(Protocol):
    """A rigid solid in the scene frame. Both methods accept any finite point and never raise."""

    @property
    def flat(self) -> bool:
        """True where one linearisation is exact everywhere."""
        ...

    def clearance(self, point: Vector) -> float:
        """At most the distance [m] from `point` to the solid; negative inside.

        A ball of this radius around the point is free, so a path can be traced in safe steps (Hart 1996, sphere
        tracing).
        """
        ...

    def linearise(self, point: Vector) -> tuple[Tangent, ...]:
        """Tangent planes of the surface near `point`: one on a smooth surface or a convex edge, several where faces
        meet in a concave corner, since all of them hold a point there."""
        ...


class SceneShapeSettings(Options):
    """Keys of a shape in a configuration file. A subclass narrows `shape` to a `Literal` of its name."""

    shape: str

    def solid(self) -> Shape:
        raise NotImplementedError


class CarvableSettings(SceneShapeSettings):
    """Settings of a shape that can also be cut out of another one."""

    def hollow(self) -> Shape:
        """The complement of the solid."""
        raise NotImplementedError


def unit(vector: Vector) -> Vector:
    length = sqrt(sum(component * component for component in vector))
    if not 0.0 < length < float("inf"):
        raise ValueError("expected a vector longer than zero")
    return (vector[0] / length, vector[1] / length, vector[2] / length)


UnitVector = Annotated[Vector, AfterValidator(unit)]


def _check(name: str, entry: object) -> None:
    if not (isinstance(entry, type) and issubclass(entry, SceneShapeSettings)):
        raise ValueError(f"weberlink.shapes: {name} is not a SceneShapeSettings")  # noqa: TRY004 - wrong name
    check_overrides(f"shape {name}", entry, SceneShapeSettings, "solid")


SHAPES: Registry[type[SceneShapeSettings]] = Registry(
    "shape",
    {
        "plane": "weberlink.slave.scenes.solids:PlaneSettings",
        "sphere": "weberlink.slave.scenes.solids:SphereSettings",
        "box": "weberlink.slave.scenes.solids:BoxSettings",
        "height_field": "weberlink.slave.scenes.height_field:HeightFieldSettings",
    },
    "weberlink.shapes",
    _check,
)
"""Settings class by the value of the key `shape`."""
