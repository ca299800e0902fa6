"""Orientations of devices that give a rotation matrix."""

from math import inf

from weberlink.geometry.rotation import Quaternion, turned, unit_quaternion
from weberlink.geometry.vector import Vector, distance


def of_matrix(first: Vector, second: Vector, third: Vector) -> Quaternion | None:
    """The unit quaternion of a rotation matrix, given by its rows; None if they are no rotation within 1e-3.

    Shepperd, "Quaternion from rotation matrix", Journal of Guidance and Control 1(3), 1978: the largest of the four
    components is taken from the diagonal, and the others from sums and differences over it.
    """
    (a, b, c), (d, e, f), (g, h, i) = first, second, third
    squares = (1.0 + a + e + i, 1.0 + a - e - i, 1.0 - a + e - i, 1.0 - a - e + i)
    largest = max(squares)
    if not 1.0 - 1e-3 < largest < inf:
        return None
    x, y, z, p, q, r = h - f, c - g, d - b, b + d, c + g, f + h
    columns = ((squares[0], x, y, z), (x, squares[1], p, q), (y, p, squares[2], r), (z, q, r, squares[3]))
    found = unit_quaternion(columns[squares.index(largest)])
    if found is None:
        return None
    axes = (turned(found, (1.0, 0.0, 0.0)), turned(found, (0.0, 1.0, 0.0)), turned(found, (0.0, 0.0, 1.0)))
    exact = all(distance(column, axis) < 1e-3 for column, axis in zip(zip(first, second, third), axes, strict=True))  # noqa: B905
    return found if exact else None
