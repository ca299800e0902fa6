"""One stage of an implicit scheme: an equation for a velocity, and Newton's method on it. Knows no scheme."""

from collections.abc import Sequence
from typing import NamedTuple

from weberlink.geometry.vector import ZERO, Vector, dot
from weberlink.slave.integrators.contract import Body, Motion
from weberlink.slave.integrators.reaction import reaction
from weberlink.slave.integrators.resistance import Resistance
from weberlink.slave.scenes.contact import Touch
from weberlink.slave.scenes.scene import Scene, SceneState

EVALUATIONS = 24
HALVINGS = 3
CONVERGED = 1e-11  # correction of a velocity, relative to the largest of its components
ROUNDING = 1e-15  # of a position [m/m]
STILL = 1e-13  # [m/s] no correction is worth less


class Stage(NamedTuple):
    """A motion, the contacts that gave its force, and whether it solves its equation."""

    motion: Motion
    touches: Sequence[Touch]
    solved: bool = True


class Equation:
    """x = origin + h v, v = driven + h a(x, v), with the acceleration of `body` under control and contact.

    Args:
        state: Where the scene is set back to before each evaluation; it is left at the last one.
        rubs: Whether friction counts.
    """

    __slots__ = ("_drive", "_inertia", "_origin", "_rubs", "_scene", "_state", "_step")

    def __init__(
        self,
        body: Body,
        scene: Scene,
        state: SceneState,
        origin: Vector,
        driven: Vector,
        goal: Vector,
        step: float,
        *,
        rubs: bool = True,
    ) -> None:
        self._scene, self._state, self._rubs = scene, state, rubs
        self._origin, self._step = origin, step
        self._drive, self._inertia = linear_part(body, origin, driven, goal, step)

    def solved(self, near: Stage) -> Stage:
        """The solution, begun from a stage `near` by; the best that was found in 24 evaluations if it has none.

        The force at the first guess is that of `near` and its derivative, so flat contact takes one evaluation. A
        step of Newton's method that leaves more than it found is halved, three times at most.
        """
        (x, y, z), velocity, force = near.motion
        origin, step = self._origin, self._step
        resistance = Resistance(near.touches, velocity, self._inertia, step, trial=self._rubs)
        u, v, w = velocity
        moved = (origin[0] + step * u - x, origin[1] + step * v - y, origin[2] + step * w - z)
        change = resistance.solved(self._left(velocity, resistance.force(moved, force)))
        stage = self._at((u + change[0], v + change[1], w + change[2]))
        left = self._left(stage.motion.velocity, stage.motion.force)
        evaluations = 1
        while evaluations < EVALUATIONS:
            velocity = stage.motion.velocity
            change = Resistance(stage.touches, velocity, self._inertia, step).solved(left)
            if self._is_rounding(change, stage.motion):
                return stage
            size = dot(left, left)
            for _ in range(HALVINGS + 1):
                stage = self._at((velocity[0] + change[0], velocity[1] + change[1], velocity[2] + change[2]))
                left = self._left(stage.motion.velocity, stage.motion.force)
                evaluations += 1
                if dot(left, left) < size:
                    break
                change = (0.5 * change[0], 0.5 * change[1], 0.5 * change[2])
        return stage._replace(solved=False)

    def _at(self, velocity: Vector) -> Stage:
        """The scene evaluated where `velocity` leads."""
        origin, step = self._origin, self._step
        position = (
            origin[0] + step * velocity[0],
            origin[1] + step * velocity[1],
            origin[2] + step * velocity[2],
        )
        self._scene.restore(self._state)
        touches = self._scene.touch(position)
        if not self._rubs:
            touches = tuple([touch._replace(drag=ZERO, grip=0.0) for touch in touches])
        return Stage(Motion(position, velocity, reaction(touches, velocity)), touches)

    def _left(self, velocity: Vector, force: Vector) -> Vector:
        """What the equation lacks [N s]."""
        drive, inertia, step = self._drive, self._inertia, self._step
        return (
            drive[0] + step * force[0] - inertia * velocity[0],
            drive[1] + step * force[1] - inertia * velocity[1],
            drive[2] + step * force[2] - inertia * velocity[2],
        )

    def _is_rounding(self, change: Vector, motion: Motion) -> bool:
        tolerance = STILL + CONVERGED * max(map(abs, motion.velocity))
        return max(map(abs, change)) <= tolerance + ROUNDING * max(map(abs, motion.position)) / self._step


def linear_part(body: Body, origin: Vector, driven: Vector, goal: Vector, step: float) -> tuple[Vector, float]:
    """Without contact: drive = inertia v, with inertia = m + h c + h^2 k and drive = m driven + h k (goal - origin)."""
    mass, control, brake = body
    pull = step * control
    drive = (
        mass * driven[0] + pull * (goal[0] - origin[0]),
        mass * driven[1] + pull * (goal[1] - origin[1]),
        mass * driven[2] + pull * (goal[2] - origin[2]),
    )
    return drive, mass + step * (brake + pull)
