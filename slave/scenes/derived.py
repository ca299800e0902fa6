"""Shapes made of other shapes: carved, turned, displaced."""

from collections.abc import Sequence
from math import cos, sin
from typing import ClassVar

from weberlink.geometry.vector import ZERO, Vector, subtract
from weberlink.slave.scenes.shape import Shape, Tangent


class CarvedShape:
    """`base` with hollows cut out of it, such as a bowl in a table: phi = max(phi_base, phi_cavity, ...).

    A cavity is the complement of what is cut out, so this is max(phi_base, -phi_cut). The largest distance is never
    more than the true one, and its surface is the one that holds the proxy: where two of them cross, the edge is
    convex.
    """

    __slots__ = ("_parts",)

    flat: ClassVar[bool] = False

    def __init__(self, base: Shape, cavities: Sequence[Shape]) -> None:
        self._parts: tuple[Shape, ...] = (base, *cavities)

    def clearance(self, point: Vector) -> float:
        return max([part.clearance(point) for part in self._parts])

    def linearise(self, point: Vector) -> tuple[Tangent, ...]:
        return max(self._parts, key=lambda part: part.clearance(point)).linearise(point)


class TurnedShape:
    """`shape` turned about `pivot` by roll, pitch, yaw [rad], R = Rz(yaw) Ry(pitch) Rx(roll), scene axes."""

    __slots__ = ("_pivot", "_rows", "_shape", "flat")

    def __init__(self, shape: Shape, pivot: Vector, roll_pitch_yaw: Vector) -> None:
        self._shape = shape
        self._pivot = pivot
        self.flat = shape.flat
        (sr, sp, sy), (cr, cp, cy) = [tuple(map(function, roll_pitch_yaw)) for function in (sin, cos)]
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
            (
                distance,
                (
                    a[0] * n[0] + a[1] * n[1] + a[2] * n[2],
                    b[0] * n[0] + b[1] * n[1] + b[2] * n[2],
                    c[0] * n[0] + c[1] * n[1] + c[2] * n[2],
                ),
            )
            for distance, n in self._shape.linearise(self._to_shape(point))
        )

    def _to_shape(self, point: Vector) -> Vector:
        pivot, (a, b, c) = self._pivot, self._rows
        x, y, z = point[0] - pivot[0], point[1] - pivot[1], point[2] - pivot[2]
        return (
            pivot[0] + a[0] * x + b[0] * y + c[0] * z,
            pivot[1] + a[1] * x + b[1] * y + c[1] * z,
            pivot[2] + a[2] * x + b[2] * y + c[2] * z,
        )


class DisplacedShape:
    """`shape` displaced by `offset` [m], which may change."""

    __slots__ = ("_shape", "flat", "offset")

    def __init__(self, shape: Shape) -> None:
        self._shape = shape
        self.flat = shape.flat
        self.offset: Vector = ZERO

    def clearance(self, point: Vector) -> float:
        return self._shape.clearance(subtract(point, self.offset))

    def linearise(self, point: Vector) -> tuple[Tangent, ...]:
        return self._shape.linearise(subtract(point, self.offset))
