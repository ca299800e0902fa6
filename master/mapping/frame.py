"""Rotation, scale and offset between the frames of device and robot, and virtual walls."""

from math import cos, radians, sin

from weberlink.geometry.rotation import Quaternion, inverse, product
from weberlink.geometry.vector import Vector, add, scale, subtract

Box = tuple[Vector, Vector]
"""Lowest and highest corner."""


class FrameMap:
    """robot = offset + motion_scale R device; forces go the other way by the transpose.

    A turn of the handle about an axis a is the same turn of the robot's tool about R a: angles are not scaled, and a
    handle level with its device is a tool level with the robot. Torques go the other way by the transpose and by the
    scale of force alone, so that a tool feels alike in its force and in its torque. The power of turning is then scaled
    by force_scale and that of moving by force_scale / motion_scale: one and the same factor with a motion_scale of 1.

    Args:
        rotation_deg: turns about the fixed x, y and z axes of the robot, in this order (R = Rz Ry Rx).
        motion_scale: metres of the robot for a metre of the hand, > 0.
        force_scale: newtons on the hand for a newton on the robot, and newton metres for newton metres; > 0.
        offset: where the device's origin is in the robot's frame [m].
    """

    __slots__ = ("_columns", "_offset", "_quaternion", "_rows", "force_scale", "motion_scale")

    def __init__(self, rotation_deg: Vector, motion_scale: float, force_scale: float, offset: Vector) -> None:
        self._rows = _matrix(rotation_deg)
        a, b, c = self._rows
        self._columns = ((a[0], b[0], c[0]), (a[1], b[1], c[1]), (a[2], b[2], c[2]))
        self._quaternion = _quaternion(rotation_deg)
        self.motion_scale = motion_scale
        self.force_scale = force_scale
        self._offset = offset

    def position(self, device: Vector) -> Vector:
        """Position of the robot [m] for a position of the device [m]."""
        return add(self._offset, scale(_times(self._rows, device), self.motion_scale))

    def way(self, robot: Vector) -> Vector:
        """Displacement of the hand [m] for a displacement of the robot [m]."""
        return scale(_times(self._columns, robot), 1.0 / self.motion_scale)

    def force(self, robot: Vector) -> Vector:
        """Force on the hand [N] for a force on the robot [N]."""
        return scale(_times(self._columns, robot), self.force_scale)

    def torque(self, robot: Vector) -> Vector:
        """Torque on the hand [N m] for a torque on the robot's tool about its tip [N m]."""
        return scale(_times(self._columns, robot), self.force_scale)

    def orientation(self, device: Quaternion) -> Quaternion:
        """Orientation of the tool in the robot's frame for that of the handle in the device's."""
        return product(self._quaternion, product(device, inverse(self._quaternion)))

    def box(self, device: Box) -> Box:
        """The smallest box along the robot's axes that holds a box of the device [m]."""
        low, high = device
        corners = [
            self.position((x, y, z)) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])
        ]
        lowest, highest = (
            tuple(choose(corner[axis] for corner in corners) for axis in range(3)) for choose in (min, max)
        )
        return (lowest[0], lowest[1], lowest[2]), (highest[0], highest[1], highest[2])

    def axes(self, device: str) -> str:
        """The axes of the robot that a device with these axes can move."""
        columns = ["xyz".index(axis) for axis in device]
        return "".join(
            axis
            for axis, row in zip("xyz", self._rows, strict=True)
            if any(abs(row[column]) > 1e-9 for column in columns)
        )


def _matrix(rotation_deg: Vector) -> tuple[Vector, Vector, Vector]:
    (cx, sx), (cy, sy), (cz, sz) = (_cos_sin(angle) for angle in rotation_deg)
    return (
        (cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx),
        (sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx),
        (-sy, cy * sx, cy * cx),
    )


def _cos_sin(degrees: float) -> tuple[float, float]:
    """Exact at multiples of a right angle."""
    quarter, rest = divmod(degrees, 90.0)
    if rest == 0.0:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarter) % 4]
    return cos(radians(degrees)), sin(radians(degrees))


def _quaternion(rotation_deg: Vector) -> Quaternion:
    halves = [_cos_sin(angle / 2.0) for angle in rotation_deg]
    about_x: Quaternion = (halves[0][0], halves[0][1], 0.0, 0.0)
    about_y: Quaternion = (halves[1][0], 0.0, halves[1][1], 0.0)
    about_z: Quaternion = (halves[2][0], 0.0, 0.0, halves[2][1])
    return product(about_z, product(about_y, about_x))


def _times(rows: tuple[Vector, Vector, Vector], v: Vector) -> Vector:
    a, b, c = rows
    return (
        a[0] * v[0] + a[1] * v[1] + a[2] * v[2],
        b[0] * v[0] + b[1] * v[1] + b[2] * v[2],
        c[0] * v[0] + c[1] * v[1] + c[2] * v[2],
    )


class Walls:
    """A box in the robot's frame: sent positions stay inside, and a hand beyond it is pushed back.

    Args:
        box: lowest and highest corner [m].
        stiffness: of the wall, felt by the hand [N/m].
    """

    __slots__ = ("_high", "_low", "_stiffness")

    def __init__(self, box: Box, stiffness: float) -> None:
        self._low, self._high = box
        self._stiffness = stiffness

    @property
    def box(self) -> Box:
        return self._low, self._high

    def inside(self, position: Vector) -> Vector:
        """The position, or the point of the box that is nearest to it [m]."""
        low, high = self._low, self._high
        return (
            min(max(position[0], low[0]), high[0]),
            min(max(position[1], low[1]), high[1]),
            min(max(position[2], low[2]), high[2]),
        )

    def force(self, way: Vector) -> Vector:
        """Force on the hand [N] at a displacement [m, device frame] beyond the wall."""
        return scale(way, -self._stiffness)

    def beyond(self, position: Vector) -> Vector:
        """How far a position is outside [m]."""
        return subtract(position, self.inside(position))
