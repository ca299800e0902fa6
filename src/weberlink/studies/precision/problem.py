"""What an integrator is asked: a body, surfaces, a start and goals, as plain records.

Knows how to hand the surfaces to an integrator as a `Scene`; the reference solutions read the same records and never
see that scene.
"""

from dataclasses import dataclass
from typing import Literal

from weberlink.geometry.vector import ZERO, Vector
from weberlink.slave.integrators.contract import ControlledMass
from weberlink.slave.scenes.contact import FrictionCone, SceneObject
from weberlink.slave.scenes.plane import PlaneShape
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.sphere import SphereShape

TICK = 1e-3  # [s] what the recommendation is made for, and how often errors are looked at

Quantity = Literal["position", "force"]


@dataclass(frozen=True)
class HalfSpace:
    """Solid below the plane through `point` [m] with the outward unit `normal`."""

    point: Vector
    normal: Vector


@dataclass(frozen=True)
class Ball:
    """Solid within `radius` [m] of `center`; with `hollow`, everywhere else."""

    center: Vector
    radius: float
    hollow: bool = False


@dataclass(frozen=True)
class Friction:
    """Coulomb coefficients of the god-object; once sliding, it sticks again below `restick` of the dynamic cone."""

    static: float
    dynamic: float
    restick: float = 0.5


@dataclass(frozen=True)
class Surface:
    """A solid and what its surface does: max(0, stiffness depth + damping d(depth)/dt) along the normal."""

    solid: HalfSpace | Ball
    stiffness: float
    damping: float = 0.0
    friction: Friction | None = None


@dataclass(frozen=True)
class Problem:
    """One body before some surfaces.

    Args:
        name: snake_case, stable.
        about: what is hard here, in a few words.
        body: mass [kg], stiffness [N/m], damping [N s/m] of m a = k (goal - x) - c v + f.
        surfaces: any number of half-spaces, or one ball.
        goals: from when [s] the goal is where [m]; the first from 0, the others at multiples of the coarsest step.
        position: at the start [m]; on a surface is allowed, inside one is not.
        velocity: at the start [m/s].
        duration: [s], a whole number of ticks.
        coarsest_ticks: the largest step that is tried, in ticks.
        smooth: quantities whose solution has no kink or jump after the start, so that an order can be fitted.
        linear: whether the forces are linear in position and velocity between touch and release.
    """

    name: str
    about: str
    body: ControlledMass
    surfaces: tuple[Surface, ...]
    goals: tuple[tuple[float, Vector], ...]
    position: Vector
    velocity: Vector = ZERO
    duration: float = 0.1
    coarsest_ticks: int = 4
    smooth: frozenset[Quantity] = frozenset()
    linear: bool = True

    def goal(self, at: float) -> Vector:
        """The goal in force at `at` [s]; a change counts from its own instant on."""
        current = self.goals[0][1]
        for since, goal in self.goals:
            if since > at + 1e-9:
                break
            current = goal
        return current

    def scene(self) -> Scene:
        """A fresh scene of the surfaces."""
        return Scene([scene_object(surface) for surface in self.surfaces])


def scene_object(surface: Surface) -> SceneObject:
    solid = surface.solid
    shape: PlaneShape | SphereShape
    if isinstance(solid, HalfSpace):
        shape = PlaneShape(solid.point, solid.normal)
    elif solid.hollow:
        shape = SphereShape(solid.center, solid.radius, inside=True)
    else:
        shape = SphereShape(solid.center, solid.radius)
    friction = surface.friction
    return SceneObject(
        shape,
        surface.stiffness,
        FrictionCone(friction.static, friction.dynamic) if friction is not None else None,
        surface.damping if surface.damping > 0.0 else None,
    )
