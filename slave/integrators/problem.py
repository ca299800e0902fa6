"""A mass under position control in contact with a scene: m a = k (goal - x) - c v + f(x, v).

    f = sum_i max(0, k_i depth_i + b_i d(depth_i)/dt) n_i + drag_i

The depths are the multipliers of the smallest push that brings the probe back to the surface, probe = proxy - sum
depth_i n_i. Where contacts are not at right angles their rates are therefore not -n_i v, but solve G rates = -n v with
the Gram matrix G of the normals (see `weberlink.slave.scenes.proxy`).
"""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

from weberlink.geometry.vector import ZERO, Vector, dot, scale, subtract
from weberlink.slave.integrators import ControlledMass, MassState
from weberlink.slave.integrators.oscillation import Oscillation
from weberlink.slave.scenes.proxy import multipliers
from weberlink.slave.scenes.scene import Scene, SceneState, Touch

ROUNDING = 1e-12  # Share of the energy that a step may gain
RESOLVED = 0.01  # Share of the energy up to which a gain is the error of a step that resolves the motion


class Stage(NamedTuple):
    """A state, its contacts, how far they push [m], and whether it solves the equation that it was computed from."""

    motion: MassState
    touches: Sequence[Touch]
    push: float
    solved: bool = True


class MassInContact:
    """The body and what it touches, the energy of both, and a step that must not gain any.

    With the goal held, dampers, slipping and the end of a contact only take energy, and so does the proxy, which moves
    toward the body. The account of motion, control spring and contact is therefore complete where nothing in the scene
    moves, and a gain is an error of the step, or a jump of stiffness between two objects.
    """

    def __init__(self, body: ControlledMass, scene: Scene) -> None:
        self.body = body
        self.scene = scene
        self.end: Stage | None = None  # Of the last step, which the next one begins with
        self._oscillations: dict[tuple[float, float], Oscillation] = {}

    def oscillation(self, stiffness: float = 0.0, damping: float = 0.0) -> Oscillation:
        """That of the body under its control, with a stiffness [N/m] and a damping [N s/m] of contact; cached."""
        key = (stiffness, damping)
        if key not in self._oscillations:
            mass, control, brake = self.body
            self._oscillations[key] = Oscillation(mass, control + stiffness, brake + damping)
        return self._oscillations[key]

    def start(self, motion: MassState) -> Stage:
        """The stage of a state, which is that of the scene."""
        end = self.end
        return self.at(motion.position, motion.velocity) if end is None or end.motion != motion else end

    def at(self, position: Vector, velocity: Vector) -> Stage:
        """The stage at this position [m] and velocity [m/s], to which the scene moves on."""
        touches = self.scene.touch(position)
        state = MassState(position, velocity, contact_force(touches, velocity))
        return Stage(state, touches, self.scene.penetration_depth)

    def energy(self, stage: Stage, goal: Vector) -> float:
        """[J]"""
        position, velocity, _ = stage.motion
        mass, stiffness, _ = self.body
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
        moving = 0.5 * self.body.mass * dot(velocity, velocity)
        if excess > most * before or excess > moving:
            return None
        velocity = scale(velocity, sqrt(1.0 - excess / moving))
        return end._replace(motion=MassState(position, velocity, contact_force(end.touches, velocity)))

    def stopped(self, start: Stage, state: SceneState) -> Stage:
        """At rest where the step began, which is always possible: the energy of motion is lost."""
        self.scene.restore(state)
        return start._replace(motion=MassState(start.motion.position, ZERO, contact_force(start.touches, ZERO)))


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
    for touch, push in zip(touches, pushes(touches, velocity), strict=True):
        n, drag, f = touch.normal, touch.drag, max(0.0, push)
        x, y, z = x + f * n[0] + drag[0], y + f * n[1] + drag[1], z + f * n[2] + drag[2]
    return (x, y, z)


def pushes(touches: Sequence[Touch], velocity: Vector) -> list[float]:
    """k depth + b d(depth)/dt of each touch [N]; a touch below 0 does not push."""
    rates = [-dot(touch.normal, velocity) for touch in touches]
    if len(touches) > 1:
        rates = list(multipliers(rates, [touch.normal for touch in touches]) or rates)
    return [touch.stiffness * touch.depth + touch.damping * rate for touch, rate in zip(touches, rates, strict=True)]


def stored_energy(touches: Sequence[Touch], push: float) -> float:
    """Energy in the springs of contact [J]: k push^2 / 2, and that of sticking friction along the surface.

    `push` [m] is from body to proxy. Where stiffnesses differ, k is their mean with the weights depth_i^2: for contacts
    at right angles that is the sum of k_i depth_i^2 / 2. At other angles different stiffnesses have no potential, and
    this is what stands for it.
    """
    weights = weighed = dragged = 0.0
    for _, depth, _, stiffness, _, drag, _ in touches:
        weights, weighed = weights + depth * depth, weighed + stiffness * depth * depth
        if drag != ZERO:
            dragged += dot(drag, drag) / stiffness
    return 0.5 * ((push * push * weighed / weights if weights > 0.0 else 0.0) + dragged)
