"""Shapes: what every one provides, those with a formula, shapes carved and turned, their settings, and their table."""

from collections.abc import Sequence
from math import copysign, cos, radians, sin, sqrt
from typing import Annotated, ClassVar, Literal, Protocol

from pydantic import AfterValidator, Field

from weberlink.geometry.vector import Vector, dot, norm, scale
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


class PlaneShape:
    """Solid below the plane through `point` with the outward `normal` (any length above zero)."""

    flat = True

    def __init__(self, point: Vector, normal: Vector) -> None:
        self._normal = scale(normal, 1.0 / norm(normal))
        self._offset = dot(self._normal, point)

    def clearance(self, point: Vector) -> float:
        n = self._normal
        return n[0] * point[0] + n[1] * point[1] + n[2] * point[2] - self._offset

    def linearise(self, point: Vector) -> tuple[Tangent, ...]:
        n = self._normal
        return ((n[0] * point[0] + n[1] * point[1] + n[2] * point[2] - self._offset, n),)


class SphereShape:
    """Solid within `radius` [m] of `center`; with `inside`, where the probe then is, solid everywhere else."""

    flat = False

    def __init__(self, center: Vector, radius: float, *, inside: bool = False) -> None:
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


class BoxShape:
    """Solid within half of `size` [m] of `center` along each axis.

    Outside, the distance is Euclidean, so an edge or corner looks round from afar; inside, the nearest face counts.
    """

    flat = False

    def __init__(self, center: Vector, size: Vector) -> None:
        self._center = center
        self._half: Vector = (size[0] / 2.0, size[1] / 2.0, size[2] / 2.0)

    def clearance(self, point: Vector) -> float:
        center, half = self._center, self._half
        x, y, z = (
            abs(point[0] - center[0]) - half[0],
            abs(point[1] - center[1]) - half[1],
            abs(point[2] - center[2]) - half[2],
        )
        if x <= 0.0 and y <= 0.0 and z <= 0.0:
            return max(x, y, z)
        x, y, z = max(x, 0.0), max(y, 0.0), max(z, 0.0)
        return sqrt(x * x + y * y + z * z)

    def linearise(self, point: Vector) -> tuple[Tangent, ...]:
        center, half = self._center, self._half
        px, py, pz = point[0] - center[0], point[1] - center[1], point[2] - center[2]
        x, y, z = abs(px) - half[0], abs(py) - half[1], abs(pz) - half[2]
        if (x > 0.0) + (y > 0.0) + (z > 0.0) > 1:
            x, y, z = max(x, 0.0), max(y, 0.0), max(z, 0.0)
            length = sqrt(x * x + y * y + z * z)
            if length > 0.0:  # excesses below 1e-162 m square to 0: then the nearest face is used
                return ((length, (copysign(x / length, px), copysign(y / length, py), copysign(z / length, pz))),)
        if z >= x and z >= y:
            return ((z, (0.0, 0.0, copysign(1.0, pz))),)
        if y >= x:
            return ((y, (0.0, copysign(1.0, py), 0.0)),)
        return ((x, (copysign(1.0, px), 0.0, 0.0)),)


class BoxCavity(BoxShape):
    """The complement of a box: floor and walls meet in concave corners."""

    def clearance(self, point: Vector) -> float:
        return min(gap for gap, _ in self.linearise(point))

    def linearise(self, point: Vector) -> tuple[Tangent, ...]:
        center, half = self._center, self._half
        px, py, pz = point[0] - center[0], point[1] - center[1], point[2] - center[2]
        return (
            (half[0] - abs(px), (copysign(1.0, -px), 0.0, 0.0)),
            (half[1] - abs(py), (0.0, copysign(1.0, -py), 0.0)),
            (half[2] - abs(pz), (0.0, 0.0, copysign(1.0, -pz))),
        )


class CarvedShape:
    """`base` with hollows cut out of it, such as a bowl in a table: phi = max(phi_base, phi_cavity, ...).

    A cavity is the complement of what is cut out, so this is max(phi_base, -phi_cut). The largest distance is never
    more than the true one, and its surface is the one that holds the proxy: where two of them cross, the edge is
    convex.
    """

    flat: ClassVar[bool] = False

    def __init__(self, base: Shape, cavities: Sequence[Shape]) -> None:
        self._parts: tuple[Shape, ...] = (base, *cavities)

    def clearance(self, point: Vector) -> float:
        return max([part.clearance(point) for part in self._parts])

    def linearise(self, point: Vector) -> tuple[Tangent, ...]:
        return max(self._parts, key=lambda part: part.clearance(point)).linearise(point)


class TurnedShape:
    """`shape` turned about `pivot` by roll, pitch, yaw [deg], R = Rz(yaw) Ry(pitch) Rx(roll), scene axes."""

    def __init__(self, shape: Shape, pivot: Vector, roll_pitch_yaw: Vector) -> None:
        self._shape = shape
        self._pivot = pivot
        self.flat = shape.flat
        roll, pitch, yaw = map(radians, roll_pitch_yaw)
        sr, sp, sy, cr, cp, cy = sin(roll), sin(pitch), sin(yaw), cos(roll), cos(pitch), cos(yaw)
        self._rows: tuple[Vector, Vector, Vector] = (
            (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
            (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
            (-sp, cp * sr, cp * cr),
        )

    def clearance(self, point: Vector) -> float:
        return self._shape.clearance(self._to_shape(point))

    def linearise(self, point: Vector) -> tuple[Tangent, ...]:
        a, b, c = self._rows
        return tuple(
            [(gap, (dot(a, n), dot(b, n), dot(c, n))) for gap, n in self._shape.linearise(self._to_shape(point))]
        )

    def _to_shape(self, point: Vector) -> Vector:
        pivot, (a, b, c) = self._pivot, self._rows
        x, y, z = point[0] - pivot[0], point[1] - pivot[1], point[2] - pivot[2]
        return (
            pivot[0] + a[0] * x + b[0] * y + c[0] * z,
            pivot[1] + a[1] * x + b[1] * y + c[1] * z,
            pivot[2] + a[2] * x + b[2] * y + c[2] * z,
        )


class PlaneSettings(CarvableSettings):
    """A half-space, solid against the normal."""

    shape: Literal["plane"]
    point_m: Vector = (0.0, 0.0, 0.0)
    normal: UnitVector = Field(default=(0.0, 0.0, 1.0), description="outward, of any length; it is normalised")

    def solid(self) -> Shape:
        return PlaneShape(self.point_m, self.normal)

    def hollow(self) -> Shape:
        return PlaneShape(self.point_m, (-self.normal[0], -self.normal[1], -self.normal[2]))


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


Edge = Annotated[float, Field(gt=0.0)]


class BoxSettings(CarvableSettings):
    """A box with sharp edges; with `side: inside`, everything but the box."""

    shape: Literal["box"]
    center_m: Vector
    size_m: tuple[Edge, Edge, Edge]
    side: Literal["outside", "inside"] = Field(default="outside", description="where the operator is")
    rotation_deg: Vector | None = Field(
        default=None, description="roll, pitch, yaw about the centre: R = Rz(yaw) Ry(pitch) Rx(roll)"
    )

    def solid(self) -> Shape:
        return self._turned(BoxShape(self.center_m, self.size_m)) if self.side == "outside" else self.hollow()

    def hollow(self) -> Shape:
        return self._turned(BoxCavity(self.center_m, self.size_m))

    def _turned(self, shape: Shape) -> Shape:
        if self.rotation_deg is None:
            return shape
        return TurnedShape(shape, self.center_m, self.rotation_deg)


def _check(name: str, entry: object) -> None:
    if not (isinstance(entry, type) and issubclass(entry, SceneShapeSettings)):
        raise ValueError(f"weberlink.shapes: {name} is not a SceneShapeSettings")  # noqa: TRY004 - wrong name
    check_overrides(f"shape {name}", entry, SceneShapeSettings, "solid")


SHAPES: Registry[type[SceneShapeSettings]] = Registry(  # settings class by the value of the key `shape`
    "shape",
    {
        "plane": "weberlink.slave.scenes.shape:PlaneSettings",
        "sphere": "weberlink.slave.scenes.shape:SphereSettings",
        "box": "weberlink.slave.scenes.shape:BoxSettings",
        "height_field": "weberlink.slave.scenes.height_field:HeightFieldSettings",
    },
    "weberlink.shapes",
    _check,
)
