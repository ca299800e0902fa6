"""Three-vectors as plain tuples of floats, and the cube that they lie in.

On three numbers, plain Python is faster than numpy. A system with fewer than three axes keeps the unused components at
exactly 0.

Lengths are computed by sums, products and a square root, which IEEE 754 rounds in one way only, so two hosts agree to
the last bit. Those of `math.hypot` and `math.dist` depend on the library of the host.
"""

from math import dist, inf, sqrt

Vector = tuple[float, float, float]

ZERO: Vector = (0.0, 0.0, 0.0)

_LEAST_SQUARE = 2.0**-900  # Above this sum of squares, a component whose square underflows changes no bit of the length
_UP, _DOWN = 2.0**600, 2.0**-600
"""Powers of two: scaling by them is exact."""


def add(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def subtract(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(a: Vector, factor: float) -> Vector:
    return (a[0] * factor, a[1] * factor, a[2] * factor)


def dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def interpolate(start: Vector, goal: Vector, share: float) -> Vector:
    """The point at this share of the way from start to goal: 0 for the start, 1 for the goal."""
    return (
        start[0] + share * (goal[0] - start[0]),
        start[1] + share * (goal[1] - start[1]),
        start[2] + share * (goal[2] - start[2]),
    )


def toward(start: tuple[float, ...], goal: tuple[float, ...], way: float) -> tuple[float, ...]:
    """The goal, or the point on the way to it that is `way` from the start; with any number of axes."""
    length = dist(start, goal)
    if not length > way:  # a way without end is NaN where no time has passed
        return goal
    share = way / length
    return tuple([a + share * (b - a) for a, b in zip(start, goal, strict=True)])


def norm(a: Vector) -> float:
    """Euclidean length, within 2 units in the last place, without overflow or underflow of the squares."""
    x, y, z = a
    square = x * x + y * y + z * z
    if _LEAST_SQUARE < square < inf:
        return sqrt(square)
    return 0.0 if x == y == z == 0.0 else _scaled_length(x, y, z)


def distance(a: Vector, b: Vector) -> float:
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    square = x * x + y * y + z * z
    if _LEAST_SQUARE < square < inf:
        return sqrt(square)
    return 0.0 if x == y == z == 0.0 else _scaled_length(x, y, z)


def within(a: Vector, limit: float) -> Vector:
    """The vector, shortened to the limit where it is longer."""
    length = norm(a)
    return a if length <= limit else scale(a, limit / length)


def unit(a: Vector) -> Vector:
    """Direction of a vector that is not zero; also of a denormal length, whose reciprocal would be infinite."""
    length = norm(a)
    return (a[0] / length, a[1] / length, a[2] / length)


def is_finite(a: Vector) -> bool:
    # x - x is 0 for every finite x and NaN otherwise: one expression, no calls.
    return a[0] - a[0] == 0.0 and a[1] - a[1] == 0.0 and a[2] - a[2] == 0.0


def _scaled_length(x: float, y: float, z: float) -> float:
    """Length of components whose squares may overflow or underflow; NaN if one of them is NaN."""
    large = abs(x) > 1.0 or abs(y) > 1.0 or abs(z) > 1.0
    there, back = (_DOWN, _UP) if large else (_UP, _DOWN)
    x, y, z = x * there, y * there, z * there
    return sqrt(x * x + y * y + z * z) * back


def cube(half_edge: float) -> tuple[Vector, Vector]:
    """Lower and upper corner."""
    return (-half_edge, -half_edge, -half_edge), (half_edge, half_edge, half_edge)


def confined(a: Vector, box: tuple[Vector, Vector]) -> Vector:
    """The point of a box that is nearest, given by its lower and upper corner."""
    (x, y, z), ((x0, y0, z0), (x1, y1, z1)) = a, box
    if x0 <= x <= x1 and y0 <= y <= y1 and z0 <= z <= z1:
        return a
    return min(max(x, x0), x1), min(max(y, y0), y1), min(max(z, z0), z1)


def check_home(home: Vector, half_edge: float) -> None:
    """See that a home position lies in the cube; raises ValueError naming both. All in metres."""
    if max(map(abs, home)) > half_edge:
        raise ValueError(f"home_m: expected a point within the workspace of +-{half_edge} m, got {home}")
