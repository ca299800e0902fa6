"""Unit quaternions (w, x, y, z): composition, the way back, and vectors turned by them.

An orientation turns the axes of what is oriented into those of the frame that it is oriented in.
"""

from weberlink.geometry.rotation import Quaternion
from weberlink.geometry.vector import Vector


def product(a: Quaternion, b: Quaternion) -> Quaternion:
    """First b, then a."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def inverse(a: Quaternion) -> Quaternion:
    """Of a unit quaternion."""
    return (a[0], -a[1], -a[2], -a[3])


def turned(a: Quaternion, v: Vector) -> Vector:
    """`v` turned by the unit quaternion `a`: v + 2 w (u x v) + 2 u x (u x v), u its vector part."""
    w, x, y, z = a
    cx, cy, cz = 2.0 * (y * v[2] - z * v[1]), 2.0 * (z * v[0] - x * v[2]), 2.0 * (x * v[1] - y * v[0])
    return (
        v[0] + w * cx + y * cz - z * cy,
        v[1] + w * cy + z * cx - x * cz,
        v[2] + w * cz + x * cy - y * cx,
    )
