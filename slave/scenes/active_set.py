"""The smallest displacement out of a few half-spaces, solved exactly: the inner problem of the proxy.

    min |d|^2  subject to  n_i . d >= v_i

It is strictly convex, so a point that satisfies the KKT conditions, d = sum lambda_i n_i with lambda_i >= 0 and every
constraint met, is the solution. In three dimensions at most three independent constraints are active, so all
candidates are tried.
"""

from collections.abc import Sequence
from itertools import combinations

from weberlink.geometry.vector import Vector, dot

Push = tuple[int, float]
"""Index of a constraint, and its multiplier lambda [m], the length of its push along the normal."""

PARALLEL = 1e-9  # determinant below which normals count as dependent
CONSTRAINTS_TRIED = 7


def smallest_push(violations: Sequence[float], normals: Sequence[Vector]) -> tuple[Push, ...]:
    """The active constraints and their multipliers; none if no constraint is violated.

    Where constraints contradict each other, only the most violated one is satisfied. Of more than seven constraints,
    the seven most violated ones are considered.

    Args:
        violations: v_i [m]: how far the target lies behind each plane; negative in front of it.
        normals: Unit vectors.
    """
    if len(violations) == 1:
        return () if violations[0] <= 0.0 else ((0, violations[0]),)
    order = sorted(range(len(violations)), key=violations.__getitem__, reverse=True)[:CONSTRAINTS_TRIED]
    if not order or violations[order[0]] <= 0.0:
        return ()
    slack = 1e-12 + 1e-9 * violations[order[0]]
    pushes: tuple[Push, ...]
    for i in order:
        pushes = ((i, violations[i]),)
        if violations[i] >= 0.0 and suffices(pushes, violations, normals, slack, order):
            return pushes
    for size in (2, 3):
        solve = SOLVERS[size - 1]
        for active in combinations(order, size):
            multipliers = solve([violations[i] for i in active], [normals[i] for i in active])
            if multipliers is None or min(multipliers) < 0.0:
                continue
            pushes = tuple(zip(active, multipliers, strict=True))
            if suffices(pushes, violations, normals, slack, order):
                return pushes
    return ((order[0], violations[order[0]]),)


def suffices(
    pushes: Sequence[Push], violations: Sequence[float], normals: Sequence[Vector], slack: float, order: Sequence[int]
) -> bool:
    """Whether the pushes meet the constraints in `order` within the slack [m]."""
    x, y, z = displacement(pushes, normals)
    for i in order:
        n = normals[i]
        if not n[0] * x + n[1] * y + n[2] * z >= violations[i] - slack:
            return False
    return True


def displacement(pushes: Sequence[Push], normals: Sequence[Vector]) -> Vector:
    x = y = z = 0.0
    for i, multiplier in pushes:
        n = normals[i]
        x, y, z = x + multiplier * n[0], y + multiplier * n[1], z + multiplier * n[2]
    return (x, y, z)


def single(v: Sequence[float], _: Sequence[Vector]) -> tuple[float, ...] | None:
    return (v[0],)


def pair(v: Sequence[float], n: Sequence[Vector]) -> tuple[float, ...] | None:
    """G lambda = v with the Gram matrix G of two normals; None where they are parallel."""
    g = dot(n[0], n[1])
    determinant = 1.0 - g * g
    if determinant < PARALLEL:
        return None
    return ((v[0] - g * v[1]) / determinant, (v[1] - g * v[0]) / determinant)


def triple(v: Sequence[float], n: Sequence[Vector]) -> tuple[float, ...] | None:
    """G lambda = v for three normals by Cramer's rule; None where they do not span space."""
    a, b, c = dot(n[0], n[1]), dot(n[0], n[2]), dot(n[1], n[2])
    determinant = 1.0 + 2.0 * a * b * c - a * a - b * b - c * c
    if determinant < PARALLEL:
        return None
    return (
        ((1.0 - c * c) * v[0] + (b * c - a) * v[1] + (a * c - b) * v[2]) / determinant,
        ((b * c - a) * v[0] + (1.0 - b * b) * v[1] + (a * b - c) * v[2]) / determinant,
        ((a * c - b) * v[0] + (a * b - c) * v[1] + (1.0 - a * a) * v[2]) / determinant,
    )


SOLVERS = (single, pair, triple)
"""Each solves for one more constraint than the one before."""
