"""Semi-implicit (symplectic) Euler: the cheapest step, for contacts that the step resolves."""

from weberlink.geometry.vector import Vector
from weberlink.slave.integrators import ControlledMass, MassState
from weberlink.slave.integrators.problem import contact_force
from weberlink.slave.scenes.scene import Scene


class SemiImplicit:
    """v += h/m (k (goal - x) - c v + f), then x += h v with the new velocity; order 1.

    One evaluation of the scene per step, at its end. Against linear contact it is stable while 2 a + b < 4 with b =
    (k + k_scene) h^2 / m and a = (c + c_scene) h / m.
    """

    def __init__(self, body: ControlledMass, scene: Scene) -> None:
        self._body = body
        self._scene = scene

    def advance(self, motion: MassState, goal: Vector, step: float) -> MassState:
        mass, stiffness, damping = self._body
        (x, y, z), (u, v, w), force = motion
        gain = step / mass
        u += gain * (stiffness * (goal[0] - x) - damping * u + force[0])
        v += gain * (stiffness * (goal[1] - y) - damping * v + force[1])
        w += gain * (stiffness * (goal[2] - z) - damping * w + force[2])
        position, velocity = (x + step * u, y + step * v, z + step * w), (u, v, w)
        return MassState(position, velocity, contact_force(self._scene.touch(position), velocity))
