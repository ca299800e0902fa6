"""Energy of a controlled mass in contact, and a step that must not gain any."""

from math import sqrt

from weberlink.geometry.vector import ZERO, Vector, dot, scale, subtract
from weberlink.slave.integrators.contact_force import contact_force, stored_energy
from weberlink.slave.integrators.contract import ControlledMass, MassState, Stage
from weberlink.slave.scenes.scene import Scene, SceneState

ROUNDING = 1e-12
"""Share of the energy that a step may gain."""
RESOLVED = 0.01
"""Share of the energy up to which a gain is the error of a step that resolves the motion."""


class EnergyGuard:
    """Whether a step, with the goal held, gains energy: of motion, of the control's spring and of contact.

    Dampers, slipping and the end of a contact only take energy, and so does the proxy, which moves toward the body. The
    account is therefore complete where nothing in the scene moves, and a gain is an error of the step, or a jump of
    stiffness between two objects.
    """

    __slots__ = ("_body", "_scene")

    def __init__(self, body: ControlledMass, scene: Scene) -> None:
        self._body = body
        self._scene = scene

    def energy(self, stage: Stage, goal: Vector) -> float:
        """[J]"""
        position, velocity, _ = stage.motion
        mass, stiffness, _ = self._body
        away = subtract(position, goal)
        spring = stiffness * dot(away, away) if stiffness > 0.0 else 0.0
        return 0.5 * (mass * dot(velocity, velocity) + spring) + stored_energy(stage.touches, stage.push)

    def kept(self, start: Stage, end: Stage, goal: Vector, most: float = RESOLVED) -> Stage | None:
        """`end` if it has no more energy than `start`, else with the velocity that the energy allows.

        None where the gain is more than the share `most` of the energy, or more than all of the motion at the end.
        """
        before, after = self.energy(start, goal), self.energy(end, goal)
        if not after > before * (1.0 + ROUNDING):
            return end
        excess = after - before
        position, velocity, _ = end.motion
        moving = 0.5 * self._body.mass * dot(velocity, velocity)
        if excess > most * before or excess > moving:
            return None
        velocity = scale(velocity, sqrt(1.0 - excess / moving))
        return end._replace(motion=MassState(position, velocity, contact_force(end.touches, velocity)))

    def stopped(self, start: Stage, state: SceneState) -> Stage:
        """At rest where the step began, which is always possible: the energy of motion is lost."""
        self._scene.restore(state)
        return start._replace(motion=MassState(start.motion.position, ZERO, contact_force(start.touches, ZERO)))
