"""Contact force on a moving mass, and its derivative for an implicit step.

    f = sum_i max(0, k_i depth_i + b_i d(depth_i)/dt) n_i + drag_i

The depths are the multipliers of the smallest push that brings the probe back to the surface, probe = proxy - sum
depth_i n_i. Where contacts are not at right angles their rates are therefore not -n_i v, but solve G rates = -n v with
the Gram matrix G of the normals (see `weberlink.slave.scenes.proxy`).
"""

from collections.abc import Sequence

from weberlink.geometry.vector import ZERO, Vector, dot
from weberlink.slave.integrators.contract import MassState, Stage
from weberlink.slave.scenes.contact import Touch
from weberlink.slave.scenes.proxy import SOLVERS
from weberlink.slave.scenes.scene import Scene

NONE: frozenset[int] = frozenset()


def contact_force(touches: Sequence[Touch], velocity: Vector) -> Vector:
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


def stored_energy(touches: Sequence[Touch], push: float) -> float:
    """Energy in the springs of contact [J]: k push^2 / 2, and that of sticking friction along the surface.

    `push` [m] is from body to proxy. Where stiffnesses differ, k is their mean with the weights depth_i^2: for contacts
    at right angles that is the sum of k_i depth_i^2 / 2. At other angles different stiffnesses have no potential, and
    this is what stands for it.
    """
    if not touches:
        return 0.0
    weights = weighed = dragged = 0.0
    for _, depth, _, stiffness, _, drag, _ in touches:
        weights, weighed = weights + depth * depth, weighed + stiffness * depth * depth
        if drag != ZERO:
            dragged += dot(drag, drag) / stiffness
    return 0.5 * ((push * push * weighed / weights if weights > 0.0 else 0.0) + dragged)


def pressing(touches: Sequence[Touch], velocity: Vector) -> frozenset[int]:
    """The objects whose contact force is more than 0."""
    if not touches:
        return NONE
    rates = depth_rates(touches, velocity)
    return frozenset(
        [t.owner for t, rate in zip(touches, rates, strict=True) if t.stiffness * t.depth + t.damping * rate > 0.0]
    )


def staged(scene: Scene, position: Vector, velocity: Vector) -> Stage:
    """The stage at this position [m] and velocity [m/s], to which the scene moves on."""
    touches = scene.touch(position)
    return Stage(MassState(position, velocity, contact_force(touches, velocity)), touches, scene.penetration_depth)


def depth_rates(touches: Sequence[Touch], velocity: Vector) -> Sequence[float]:
    """d(depth)/dt [m/s] of each touch; that of each touch alone where the normals are linearly dependent."""
    rates = [-dot(touch.normal, velocity) for touch in touches]
    if len(touches) == 1:
        return rates
    solved = by_normals(touches, rates)
    return rates if solved is None else solved


def by_normals(touches: Sequence[Touch], products: Sequence[float]) -> Sequence[float] | None:
    """The s_i with n_j . (sum s_i n_i) = `products`; None where the normals are linearly dependent."""
    if len(touches) > len(SOLVERS):
        return None
    return SOLVERS[len(touches) - 1](products, [touch.normal for touch in touches])


class ContactResistance:
    """The 3 x 3 matrix inertia - h df/dv - h^2 df/dx of contacts; inertia is m + h c + h^2 k of the body [kg].

    The matrix is never written out. With the dual vectors g_i of the normals n_i (g_i . n_j = 1 if i = j, else 0) that
    of springs and dampers is sum (h^2 k_i + h b_i) n_i g_i, whose inverse follows by components along the n_i; across
    all normals only the grip of friction acts. The share of one contact's grip along another's normal is overestimated
    as 1: Newton's method then takes a few steps more, but does not overshoot. A `trial` treats every contact with
    friction as sticking, since sliding is a result of the step.
    """

    __slots__ = ("_across", "_along", "_grip", "_touches")

    def __init__(
        self, touches: Sequence[Touch], velocity: Vector, inertia: float, step: float, *, trial: bool = False
    ) -> None:
        self._touches = touches
        self._grip = 0.0
        for touch in touches:
            rubs = touch.grip > 0.0 or (trial and touch.drag != ZERO)
            self._grip += touch.stiffness if rubs else 0.0
        squared = step * step
        self._across = inertia + squared * self._grip
        self._along: list[float] = []
        for touch, rate in zip(touches, depth_rates(touches, velocity) if touches else (), strict=True):
            pushes = touch.stiffness * touch.depth + touch.damping * rate > 0.0
            shared = inertia + squared * (self._grip if len(touches) > 1 else 0.0)
            self._along.append(shared + (step * (step * touch.stiffness + touch.damping) if pushes else 0.0))

    def solved(self, push: Vector) -> Vector:
        """The change of velocity [m/s] under `push` [N s]."""
        if not self._touches:
            return (push[0] / self._across, push[1] / self._across, push[2] / self._across)
        shares = self._shares(push)
        if shares is None:  # dependent normals: no faster than the stiffest of them all
            total = sum(self._along)
            return (push[0] / total, push[1] / total, push[2] / total)
        x, y, z = push
        p = q = r = 0.0
        for touch, share, along in zip(self._touches, shares, self._along, strict=True):
            n = touch.normal
            x, y, z = x - share * n[0], y - share * n[1], z - share * n[2]
            part = share / along
            p, q, r = p + part * n[0], q + part * n[1], r + part * n[2]
        return (p + x / self._across, q + y / self._across, r + z / self._across)

    def force(self, moved: Vector, force: Vector) -> Vector:
        """The contact force [N] after the body `moved` [m] at the same velocity, to first order."""
        shares = self._shares(moved) if self._touches else None
        if shares is None:
            return force
        x, y, z = moved
        fx, fy, fz = force
        for touch, share in zip(self._touches, shares, strict=True):
            n = touch.normal
            x, y, z = x - share * n[0], y - share * n[1], z - share * n[2]
            f = touch.stiffness * share
            fx, fy, fz = fx - f * n[0], fy - f * n[1], fz - f * n[2]
        grip = self._grip
        return (fx - grip * x, fy - grip * y, fz - grip * z)

    def _shares(self, vector: Vector) -> Sequence[float] | None:
        """The components of `vector` along the normals."""
        touches = self._touches
        if len(touches) == 1:
            return (dot(touches[0].normal, vector),)
        return by_normals(touches, [dot(touch.normal, vector) for touch in touches])
