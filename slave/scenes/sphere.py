"""A ball, and the hollow that it leaves."""

from math import sqrt

from weberlink.geometry.vector import Vector
from weberlink.slave.scenes.shape import Tangent


class Sphere:
    """Solid within `radius` [m] of `center`."""

    __slots__ = ("_radius", "_x", "_y", "_z")

    flat = False

    def __init__(self, center: Vector, radius: float) -> None:
        if not radius > 0.0:
            raise ValueError(f"radius: expected more than 0 m, got {radius}")
        self._x, self._y, self._z = center
        self._radius = radius

    def clearance(self, point: Vector) -> float:
        x, y, z = point[0] - self._x, point[1] - self._y, point[2] - self._z
        return sqrt(x * x + y * y + z * z) - self._radius

    def linearise(self, point: Vector) -> tuple[Tangent, ...]:
        x, y, z = point[0] - self._x, point[1] - self._y, point[2] - self._z
        length = sqrt(x * x + y * y + z * z)
        if length == 0.0:
            return ((-self._radius, (0.0, 0.0, 1.0)),)  # every direction leads out equally far
        return ((length - self._radius, (x / length, y / length, z / length)),)


class SphereCavity:
    """Solid everywhere beyond `radius` [m] of `center`: the operator is inside, and is pushed toward the centre."""

    __slots__ = ("_radius", "_x", "_y", "_z")

    flat = False

    def __init__(self, center: Vector, radius: float) -> None:
        if not radius > 0.0:
            raise ValueError(f"radius: expected more than 0 m, got {radius}")
        self._x, self._y, self._z = center
        self._radius = radius

    def clearance(self, point: Vector) -> float:
        x, y, z = point[0] - self._x, point[1] - self._y, point[2] - self._z
        return self._radius - sqrt(x * x + y * y + z * z)

    def linearise(self, point: Vector) -> tuple[Tangent, ...]:
        x, y, z = point[0] - self._x, point[1] - self._y, point[2] - self._z
        length = sqrt(x * x + y * y + z * z)
        if length == 0.0:
            return ((self._radius, (0.0, 0.0, 1.0)),)
        return ((self._radius - length, (-x / length, -y / length, -z / length)),)
