"""What the scene does to the joints within one implicit step: springs, dampers and friction where the tip touches it.

With the Jacobian J of the tip, the depth d before the step of length h and the joint velocities w after it, a contact
of normal n pushes with f = k (d - h n.J w) - b n.J w along n, and its friction with drag - h grip J w across n.
"""

from collections.abc import Sequence

from weberlink.geometry.vector import Vector
from weberlink.slave.emulators.pose import Jacobian, Joints, Symmetric
from weberlink.slave.scenes.contact import Touch


class TipContact:
    """The contacts of one step.

    Args:
        touches: Of the scene, with the tip where the step begins.
        jacobian: There [m].
        step: Its length [s].
    """

    __slots__ = ("_jacobian", "_step", "_touching")

    def __init__(self, touches: Sequence[Touch], jacobian: Jacobian, step: float) -> None:
        self._jacobian = jacobian
        self._step = step
        self._touching = [(touch, along(jacobian, touch.normal)) for touch in touches]

    def added(self, a: Symmetric, r: Sequence[float]) -> tuple[Symmetric, list[float]]:
        """Inertia and momentum of the step with these contacts."""
        h, jacobian = self._step, self._jacobian
        a, (r0, r1, r2, r3) = a.copy(), r
        for touch, row in self._touching:
            n, (x, y, z), push = touch.normal, touch.drag, touch.stiffness * touch.depth
            f = along(jacobian, (push * n[0] + x, push * n[1] + y, push * n[2] + z))
            r0, r1, r2, r3 = r0 + h * f[0], r1 + h * f[1], r2 + h * f[2], r3 + h * f[3]
            grip = h * h * touch.grip
            _add(a, row, h * (h * touch.stiffness + touch.damping) - grip)
            if grip > 0.0:
                for axis in jacobian:
                    _add(a, axis, grip)
        return a, [r0, r1, r2, r3]

    def lets_go(self, w: Joints) -> bool:
        """Drop the contacts that would pull at these velocities [rad/s]; whether there were any."""
        kept = [(touch, row) for touch, row in self._touching if self._push(touch, row, w) >= 0.0]
        dropped = len(kept) < len(self._touching)
        self._touching = kept
        return dropped

    def force(self, w: Joints) -> Vector:
        """On the tip during the step [N]."""
        x = y = z = 0.0
        mx, my, mz = (self._step * dot4(row, w) for row in self._jacobian)
        for touch, row in self._touching:
            n, drag, grip = touch.normal, touch.drag, touch.grip
            # Along the normal the grip does not hold.
            f = self._push(touch, row, w) + self._step * grip * dot4(row, w)
            x += f * n[0] + drag[0] - grip * mx
            y += f * n[1] + drag[1] - grip * my
            z += f * n[2] + drag[2] - grip * mz
        return (x, y, z)

    def _push(self, touch: Touch, row: Joints, w: Joints) -> float:
        return touch.stiffness * touch.depth - (self._step * touch.stiffness + touch.damping) * dot4(row, w)


def along(jacobian: Jacobian, vector: Vector) -> Joints:
    """J^T of a vector."""
    x, y, z = jacobian
    a, b, c = vector
    return (
        x[0] * a + y[0] * b,
        x[1] * a + y[1] * b + z[1] * c,
        x[2] * a + y[2] * b + z[2] * c,
        x[3] * a + y[3] * b + z[3] * c,
    )


def dot4(a: Joints, b: Joints) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]


def _add(a: Symmetric, row: Joints, factor: float) -> None:
    """a += factor row row^T"""
    j0, j1, j2, j3 = row
    k0, k1, k2, k3 = factor * j0, factor * j1, factor * j2, factor * j3
    a[0] += k0 * j0
    a[1] += k1 * j0
    a[2] += k1 * j1
    a[3] += k2 * j0
    a[4] += k2 * j1
    a[5] += k2 * j2
    a[6] += k3 * j0
    a[7] += k3 * j1
    a[8] += k3 * j2
    a[9] += k3 * j3
