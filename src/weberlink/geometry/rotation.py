"""Orientations as unit quaternions (w, x, y, z) and as rotation vectors: the unit axis times the angle [rad].

An orientation maps a vector in body axes to the axes of the reference frame: `turned(orientation, v)`.

The codec carries rotation vectors: the angle between two rotations is at most the distance of their vectors (the
exponential map of SO(3) does not stretch), so a deadband on the vectors also bounds the rotations. A rotation has more
than one vector: about an axis u, the angles a and a - 2 pi are the same rotation. `vector` returns the one that is
nearer to the last vector, if its length is within `LONGEST`. So a tremor about half a turn makes no jump.

These functions are not part of the codec's closed loop: the two hosts need not agree on the last bit.
"""

from math import atan2, cos, inf, pi, sin, sqrt

from weberlink.geometry.vector import ZERO, Vector, distance, norm, scale

Quaternion = tuple[float, float, float, float]
"""(w, x, y, z) of unit length; a quaternion and its negative are the same rotation."""

IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)

LONGEST = 3.27  # Largest length of a rotation vector [rad]; it fits into 16 bits in steps of 1e-4 rad
_SMALL = 1e-8  # Below this half angle [rad], its sine is the angle itself, to the last bit


def vector(orientation: Quaternion, near: Vector = ZERO) -> Vector:
    """The rotation vector of a unit quaternion [rad].

    Args:
        orientation: with either sign.
        near: the last vector [rad]; of the two vectors of the rotation, the nearer one within `LONGEST` is returned.
    """
    w, x, y, z = orientation if orientation[0] >= 0.0 else negative(orientation)
    length = norm((x, y, z))
    if length < _SMALL * w:
        return (2.0 * x / w, 2.0 * y / w, 2.0 * z / w)
    angle = 2.0 * atan2(length, w)
    shortest = scale((x, y, z), angle / length)
    other = 2.0 * pi - angle
    if other > LONGEST:
        return shortest
    longer = scale((x, y, z), -other / length)
    return longer if distance(longer, near) < distance(shortest, near) else shortest


def quaternion(rotation: Vector) -> Quaternion:
    """The unit quaternion of a rotation vector [rad] of any length."""
    angle = norm(rotation)
    half = 0.5 * angle
    factor = sin(half) / angle if half > _SMALL else 0.5
    return (cos(half), rotation[0] * factor, rotation[1] * factor, rotation[2] * factor)


def unit_quaternion(orientation: Quaternion) -> Quaternion | None:
    """The same orientation at unit length; None if it is not finite, or shorter than 1e-6."""
    w, x, y, z = orientation
    square = w * w + x * x + y * y + z * z
    if not 1e-12 < square < inf:
        return None
    factor = 1.0 / sqrt(square)
    return (w * factor, x * factor, y * factor, z * factor)


def angle_between(a: Quaternion, b: Quaternion) -> float:
    """The angle of the rotation from one orientation to the other, 0 to pi [rad]."""
    (aw, ax, ay, az), (bw, bx, by, bz) = a, b
    w = aw * bw + ax * bx + ay * by + az * bz
    x = aw * bx - ax * bw - ay * bz + az * by
    y = aw * by - ay * bw - az * bx + ax * bz
    z = aw * bz - az * bw - ax * by + ay * bx
    return 2.0 * atan2(norm((x, y, z)), abs(w))


def toward(start: Quaternion, goal: Quaternion, angle: float) -> Quaternion:
    """The orientation on the shortest way to the goal at this angle [rad] from the start; the goal if it is nearer.

    Spherical linear interpolation (Shoemake, "Animating rotation with quaternion curves", SIGGRAPH 1985).
    """
    whole = angle_between(start, goal)
    if whole <= angle:
        return goal
    (aw, ax, ay, az), (bw, bx, by, bz) = start, goal
    sign = 1.0 if aw * bw + ax * bx + ay * by + az * bz >= 0.0 else -1.0
    own, its = sin(0.5 * (whole - angle)) / sin(0.5 * whole), sign * sin(0.5 * angle) / sin(0.5 * whole)
    mixed = (own * aw + its * bw, own * ax + its * bx, own * ay + its * by, own * az + its * bz)
    return unit_quaternion(mixed) or goal


def negative(orientation: Quaternion) -> Quaternion:
    """The other quaternion of the same rotation."""
    w, x, y, z = orientation
    return (-w, -x, -y, -z)


def product(a: Quaternion, b: Quaternion) -> Quaternion:
    """The rotation b followed by the rotation a."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def inverse(a: Quaternion) -> Quaternion:
    """The inverse of a unit quaternion."""
    return (a[0], -a[1], -a[2], -a[3])


def turned(a: Quaternion, v: Vector) -> Vector:
    """`v` turned by the unit quaternion `a`: v + 2 w (u x v) + 2 u x (u x v), u its vector part."""
    w, x, y, z = a
    cx, cy, cz = 2.0 * (y * v[2] - z * v[1]), 2.0 * (z * v[0] - x * v[2]), 2.0 * (x * v[1] - y * v[0])
    return (v[0] + w * cx + y * cz - z * cy, v[1] + w * cy + z * cx - x * cz, v[2] + w * cz + x * cy - y * cx)
