"""The proxy (god-object): where the probe would be if the solids were rigid.

Zilles and Salisbury, "A constraint-based god-object method for haptic display", IROS 1995: it stays outside every
solid and moves to the locally closest point to the probe.
"""

from collections.abc import Sequence
from itertools import combinations
from math import inf, sqrt

from weberlink.geometry.vector import ZERO, Vector, distance, dot, interpolate
from weberlink.slave.scenes.shape import Shape

Push = tuple[int, float]  # Index of a constraint, and its multiplier lambda, the length of its push along the normal

PARALLEL = 1e-9  # determinant below which normals count as dependent
CONSTRAINTS_TRIED = 7


def smallest_push(violations: Sequence[float], normals: Sequence[Vector]) -> tuple[Sequence[Push], Vector]:
    """The active constraints with their multipliers, and the displacement; none if no constraint is violated.

    A violation v_i is how far the target lies behind a plane [m], negative in front of it; normals are unit vectors.
    Where constraints contradict each other, only the most violated one is satisfied. Of more than seven, the seven most
    violated ones are considered.
    """
    deepest = max(violations, default=0.0)
    if deepest <= 0.0:
        return (), ZERO
    slack = 1e-12 + 1e-9 * deepest
    if len(violations) == 2:  # clear of every limit below, a shorter way to the same bits
        (v, w), (m, n) = violations, normals
        g = m[0] * n[0] + m[1] * n[1] + m[2] * n[2]
        determinant, a, b = 1.0 - g * g, v - g * w, w - g * v
        if determinant > 1e-3 and a > 2.0 * slack < b:
            a, b = a / determinant, b / determinant
            push = (a * m[0] + b * n[0], a * m[1] + b * n[1], a * m[2] + b * n[2])
            return (((0, a), (1, b)) if v >= w else ((1, b), (0, a))), push
    order = sorted(range(len(violations)), key=violations.__getitem__, reverse=True)[:CONSTRAINTS_TRIED]
    least = [(normals[i], violations[i] - slack) for i in order]
    for size in (1, 2, 3):
        for active in combinations(order, size):
            found = multipliers([violations[i] for i in active], [normals[i] for i in active])
            if found is None or min(found) < 0.0:
                continue
            x = y = z = 0.0
            for i, multiplier in zip(active, found, strict=True):
                n = normals[i]
                x, y, z = x + multiplier * n[0], y + multiplier * n[1], z + multiplier * n[2]
            for n, way in least:
                if not n[0] * x + n[1] * y + n[2] * z >= way:
                    break
            else:
                return tuple(zip(active, found, strict=True)), (x, y, z)
    depth, n = violations[order[0]], normals[order[0]]
    return ((order[0], depth),), (depth * n[0], depth * n[1], depth * n[2])


def multipliers(v: Sequence[float], n: Sequence[Vector]) -> tuple[float, ...] | None:
    """G lambda = v with the Gram matrix G of up to three normals; None where they are dependent, and for more."""
    if len(n) == 1:
        return (v[0],)
    if len(n) == 2:
        g = dot(n[0], n[1])
        determinant = 1.0 - g * g
        if determinant < PARALLEL:
            return None
        return ((v[0] - g * v[1]) / determinant, (v[1] - g * v[0]) / determinant)
    if len(n) != 3:
        return None
    a, b, c = dot(n[0], n[1]), dot(n[0], n[2]), dot(n[1], n[2])
    determinant = 1.0 + 2.0 * a * b * c - a * a - b * b - c * c
    if determinant < PARALLEL:
        return None
    return (  # by Cramer's rule
        ((1.0 - c * c) * v[0] + (b * c - a) * v[1] + (a * c - b) * v[2]) / determinant,
        ((b * c - a) * v[0] + (1.0 - b * b) * v[1] + (a * b - c) * v[2]) / determinant,
        ((a * c - b) * v[0] + (a * b - c) * v[1] + (1.0 - a * a) * v[2]) / determinant,
    )


ShapePress = tuple[int, float, Vector]  # Index of the shape that the probe is in, depth [m], unit direction out of it

TOUCHING = 1e-7  # [m] closer than this counts as on the surface
CONVERGED = 1e-10  # [m]
ITERATIONS = 8
TRACE_STEPS = 32
SAME_PATCH = 0.9  # cosine between normals that still belong to one smooth patch of surface
FARTHEST_SHARE = 20.0


class Proxy:
    """Follows the probe over `shapes` and reports what holds it back.

    Shapes that the proxy does not touch are searched along the straight path (sphere tracing), so a thin solid cannot
    be jumped over. A shape that it touches is linearised at the current candidate, the smallest push out of all tangent
    planes gives the next candidate, and so on until it rests: one step on a plane, two or three on smooth surfaces.
    """

    def __init__(self, shapes: Sequence[Shape]) -> None:
        self._shapes = tuple(shapes)
        self.at: Vector | None = None  # Position; None until the first target, which it adopts even inside a solid
        self.parts: Sequence[ShapePress] = ()  # The last presses, one for each plane, of which a corner has several

    def follow(self, target: Vector) -> tuple[Vector, Sequence[ShapePress]]:
        """Move toward the probe at `target` as far as the solids allow; no presses if it arrives."""
        shapes = self._shapes
        here = target if self.at is None else self.at
        free = inf  # of shapes that are not touched, around `here`
        touching: list[int] = []
        for index, shape in enumerate(shapes):
            clearance = shape.clearance(here)
            if clearance < TOUCHING:
                touching.append(index)
            elif clearance < free:
                free = clearance
        presses: Sequence[ShapePress] = ()
        last: tuple[Vector, Vector, ShapePress] | None = None  # start, end and press of the last iteration
        iterations = 0
        while iterations < ITERATIONS:
            goal, presses = self._closest(here, target, touching)
            x, y, z = step = goal[0] - here[0], goal[1] - here[1], goal[2] - here[2]
            way = sqrt(x * x + y * y + z * z)
            settled = not touching or way < CONVERGED or (len(touching) == 1 and shapes[touching[0]].flat)
            if not settled and len(presses) == 1:
                (press,), reached = presses, goal
                if last is not None:
                    goal = extrapolated(goal, step, press, *last)
                    way = distance(here, goal)
                last = (here, reached, press)
            free -= way
            if free < 0.0:
                hit = self._first_hit(here, goal, touching)
                if hit is not None:
                    index, here = hit
                    touching.append(index)  # not counted as an iteration: at most once per shape
                    last = None
                    continue
            here = goal
            if settled:
                break
            iterations += 1
        self.at = here
        return here, presses

    def _closest(self, here: Vector, target: Vector, touching: Sequence[int]) -> tuple[Vector, Sequence[ShapePress]]:
        """The point nearest to `target` in front of the tangent planes seen from `here`."""
        self.parts = ()
        if not touching:
            return target, ()
        x, y, z = target[0] - here[0], target[1] - here[1], target[2] - here[2]
        planes = self._shapes[touching[0]].linearise(here)
        if len(planes) == len(touching) == 1:
            ((gap, n),) = planes
            depth = -(n[0] * x + n[1] * y + n[2] * z + gap)
            if depth <= 0.0:
                return target, ()
            self.parts = ((touching[0], depth, n),)
            return (target[0] + depth * n[0], target[1] + depth * n[1], target[2] + depth * n[2]), self.parts
        owners: list[int] = []
        violations: list[float] = []
        normals: list[Vector] = []
        for index in touching:
            for gap, n in planes if index == touching[0] else self._shapes[index].linearise(here):
                owners.append(index)
                violations.append(-(n[0] * x + n[1] * y + n[2] * z + gap))
                normals.append(n)
        pushes, (x, y, z) = smallest_push(violations, normals)
        goal = (target[0] + x, target[1] + y, target[2] + z)
        self.parts = parts = [(owners[i], depth, normals[i]) for i, depth in pushes if depth > 0.0]
        return goal, parts if len(owners) == len(touching) else merged(parts)

    def _first_hit(self, start: Vector, end: Vector, touching: Sequence[int]) -> tuple[int, Vector] | None:
        """The first shape not yet touched on the straight path, and the point where the path meets it."""
        x, y, z = end[0] - start[0], end[1] - start[1], end[2] - start[2]
        free = length = sqrt(x * x + y * y + z * z)
        first: int | None = None
        for index, shape in enumerate(self._shapes):
            if index in touching or shape.clearance(start) >= length:
                continue
            travelled = traced(shape, start, end, free)
            if travelled is not None:
                first, free = index, travelled
        return None if first is None else (first, point_at(start, end, free, length))


def extrapolated(
    goal: Vector, step: Vector, press: ShapePress, before: Vector, reached: Vector, pressed: ShapePress
) -> Vector:
    """Limit of two steps on one smooth patch of surface (Anderson acceleration of depth one).

    Tangent planes alone converge at the rate depth / radius of curvature, which is slow where the probe is deep. Steps
    across an edge are not extrapolated.
    """
    (owner, _, n), (last_owner, _, last_n) = press, pressed
    if owner != last_owner or last_n[0] * n[0] + last_n[1] * n[1] + last_n[2] * n[2] < SAME_PATCH:
        return goal
    x, y, z = step
    dx, dy, dz = x - (reached[0] - before[0]), y - (reached[1] - before[1]), z - (reached[2] - before[2])
    squared = dx * dx + dy * dy + dz * dz
    share = (x * dx + y * dy + z * dz) / squared if squared else 0.0
    if abs(share) > FARTHEST_SHARE:
        return goal
    return (
        goal[0] - (goal[0] - reached[0]) * share,
        goal[1] - (goal[1] - reached[1]) * share,
        goal[2] - (goal[2] - reached[2]) * share,
    )


def traced(shape: Shape, start: Vector, end: Vector, limit: float) -> float | None:
    """Length [m] of the path toward `end` that is free of `shape`; None if it is free up to `limit`.

    A path that grazes the shape for too many steps counts as touching where the search ends.
    """
    length = distance(start, end)
    travelled = 0.0
    for _ in range(TRACE_STEPS):
        clearance = shape.clearance(point_at(start, end, travelled, length))
        if clearance < TOUCHING:
            return travelled
        travelled += clearance
        if travelled >= limit:
            return None
    return travelled


def point_at(start: Vector, end: Vector, travelled: float, length: float) -> Vector:
    """The point of a straight path of this length [m] after `travelled` [m]."""
    return interpolate(start, end, travelled / length) if length > 0.0 else start


def merged(presses: list[ShapePress]) -> Sequence[ShapePress]:
    """One press per shape: in a concave corner the sum of the pushes of its faces."""
    owners = dict.fromkeys([index for index, _, _ in presses])
    if len(owners) == len(presses):
        return presses
    result: list[ShapePress] = []
    for owner in owners:
        x = y = z = 0.0
        for index, depth, n in presses:
            if index == owner:
                x, y, z = x + depth * n[0], y + depth * n[1], z + depth * n[2]
        depth = (x * x + y * y + z * z) ** 0.5
        if depth > 0.0:
            result.append((owner, depth, (x / depth, y / depth, z / depth)))
    return result
