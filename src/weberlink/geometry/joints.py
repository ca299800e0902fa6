"""Vectors of joint values as plain tuples of floats, of any length, and their parts of three.

What works on three numbers at once serves arms by parts: the axes in order, three to a part, the last part filled up
with exact zeros.
"""

from collections.abc import Sequence

from weberlink.geometry.vector import Vector

Joints = tuple[float, ...]

PART = 3  # Axes of a part
MOST_JOINTS = 8  # Largest number of joints of an arm, without its gripper


def is_finite(values: Joints) -> bool:
    undefined = 0.0
    for value in values:
        undefined += value - value  # NaN where a value is not finite
    return undefined == 0.0


def parts(values: Joints) -> list[Vector]:
    """The values, three to a part."""
    filled = (*values, 0.0, 0.0)
    return [(filled[i], filled[i + 1], filled[i + 2]) for i in range(0, len(values), PART)]


def joined(vectors: Sequence[Vector], count: int) -> Joints:
    """The first `count` values of the parts in order."""
    flat: list[float] = []
    for vector in vectors:
        flat.extend(vector)
    return tuple(flat[:count])
