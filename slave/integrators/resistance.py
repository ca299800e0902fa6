"""How contact resists a change of velocity within one implicit step: a 3 x 3 matrix that is never written out."""

from collections.abc import Sequence

from weberlink.geometry.vector import ZERO, Vector, dot
from weberlink.slave.integrators.reaction import by_normals, depth_rates
from weberlink.slave.scenes.contact import Touch


class Resistance:
    """inertia - h df/dv - h^2 df/dx for the contacts `touches` of a body at `velocity`.

    With the dual vectors g_i of the normals n_i (g_i . n_j = 1 if i = j, else 0) the matrix of springs and dampers is
    sum (h^2 k_i + h b_i) n_i g_i, whose inverse follows by components along the n_i; what is across all of them meets
    the grip of friction alone. The share of one contact's grip along another's normal is counted in full, more than it
    is: Newton's method then takes a few steps more, and none too far.

    Args:
        inertia: m + h c + h^2 k of the body and its control [kg].
        step: h [s].
        trial: Count every contact that rubs as gripping: whether it drags along is what comes out.
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
