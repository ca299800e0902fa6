"""The contact force on a body that has a velocity: springs and dampers along normals, and friction.

    f = sum_i max(0, k_i depth_i + b_i d(depth_i)/dt) n_i + drag_i

The depths are the multipliers of the smallest push that brings the probe back to the surface, probe = proxy - sum
depth_i n_i. For contacts that are not at right angles their rates are therefore not -n_i v, but solve G rates = -n v
with the Gram matrix G of the normals (see `weberlink.slave.scenes.active_set`).
"""

from collections.abc import Sequence

from weberlink.geometry.vector import ZERO, Vector, dot
from weberlink.slave.scenes.active_set import pair, single, triple
from weberlink.slave.scenes.contact import Touch

SOLVERS = (single, pair, triple)
NONE: frozenset[int] = frozenset()


def reaction(touches: Sequence[Touch], velocity: Vector) -> Vector:
    """Contact force [N] on a body that moves at `velocity` [m/s]."""
    if not touches:
        return ZERO
    if len(touches) == 1:
        _, depth, n, stiffness, damping, drag, _ = touches[0]
        f = stiffness * depth
        if damping > 0.0:
            f = max(0.0, f - damping * (n[0] * velocity[0] + n[1] * velocity[1] + n[2] * velocity[2]))
        return (f * n[0] + drag[0], f * n[1] + drag[1], f * n[2] + drag[2])
    x = y = z = 0.0
    for touch, rate in zip(touches, depth_rates(touches, velocity), strict=True):
        n, drag = touch.normal, touch.drag
        f = max(0.0, touch.stiffness * touch.depth + touch.damping * rate)
        x, y, z = x + f * n[0] + drag[0], y + f * n[1] + drag[1], z + f * n[2] + drag[2]
    return (x, y, z)


def pressing(touches: Sequence[Touch], velocity: Vector) -> frozenset[int]:
    """The objects that push: touched, and not left faster than their dampers can follow."""
    if not touches:
        return NONE
    rates = depth_rates(touches, velocity)
    return frozenset(
        [t.owner for t, rate in zip(touches, rates, strict=True) if t.stiffness * t.depth + t.damping * rate > 0.0]
    )


def depth_rates(touches: Sequence[Touch], velocity: Vector) -> Sequence[float]:
    """d(depth)/dt [m/s] of each touch; as if each were alone where their normals depend on each other."""
    rates = [-dot(touch.normal, velocity) for touch in touches]
    if len(touches) == 1:
        return rates
    solved = by_normals(touches, rates)
    return rates if solved is None else solved


def by_normals(touches: Sequence[Touch], products: Sequence[float]) -> Sequence[float] | None:
    """The s_i with n_j . (sum s_i n_i) = `products`; None where the normals depend on each other."""
    if len(touches) > len(SOLVERS):
        return None
    return SOLVERS[len(touches) - 1](products, [touch.normal for touch in touches])
