"""Three-vectors as plain tuples of floats.

Scalar Python beats small arrays here: the four predictions of a tick cost about 1 us with tuples against 17 us with
numpy. A system with fewer than three axes keeps the unused components at exactly 0.

Lengths are sums, products and square roots, which IEEE 754 rounds in one way: two hosts, or this source interpreted
and compiled, agree to the last bit. `math.hypot` is as exact, and as its library likes.
"""

from math import inf, sqrt

Vector = tuple[float, float, float]

ZERO: Vector = (0.0, 0.0, 0.0)

_LEAST_SQUARE = 2.0**-900
"""What a component whose square underflows adds to a larger one is below its last place."""
_UP, _DOWN = 2.0**600, 2.0**-600
"""Powers of two: scaling by them rounds nothing."""


def add(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def subtract(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(a: Vector, factor: float) -> Vector:
    return (a[0] * factor, a[1] * factor, a[2] * factor)


def dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def norm(a: Vector) -> float:
    """Euclidean length, without overflow or underflow on the way to it; within 2 units in the last place."""
    x, y, z = a
    square = x * x + y * y + z * z
    return sqrt(square) if _LEAST_SQUARE < square < inf else _scaled_length(x, y, z)


def distance(a: Vector, b: Vector) -> float:
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    square = x * x + y * y + z * z
    return sqrt(square) if _LEAST_SQUARE < square < inf else _scaled_length(x, y, z)


def unit(a: Vector) -> Vector:
    """Direction of a vector that is not zero; right for denormal lengths too, whose reciprocal would be infinite."""
    length = norm(a)
    return (a[0] / length, a[1] / length, a[2] / length)


def is_finite(a: Vector) -> bool:
    # x - x is 0 for every finite x and NaN otherwise: one expression, no calls.
    return a[0] - a[0] == 0.0 and a[1] - a[1] == 0.0 and a[2] - a[2] == 0.0


def _scaled_length(x: float, y: float, z: float) -> float:
    """Of components whose squares may leave the range of numbers; not a number where one of them is none."""
    if x == 0.0 and y == 0.0 and z == 0.0:
        return 0.0
    large = abs(x) > 1.0 or abs(y) > 1.0 or abs(z) > 1.0
    there, back = (_DOWN, _UP) if large else (_UP, _DOWN)
    x, y, z = x * there, y * there, z * there
    return sqrt(x * x + y * y + z * z) * back
