"""Bodies and scenes that the integrators are measured on, and how one is run through them."""

from collections.abc import Callable

from weberlink.geometry.vector import ZERO, Vector
from weberlink.slave.integrators import INTEGRATORS, ControlledMass, MassState
from weberlink.slave.integrators.problem import contact_force
from weberlink.slave.scenes.contact import FrictionCone, SceneObject
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.solids import PlaneShape, SphereShape

UP: Vector = (0.0, 0.0, 1.0)
BODY = ControlledMass(0.2, 500.0, 5.0)


def wall(stiffness: float, damping: float | None = None, friction: FrictionCone | None = None) -> Scene:
    return Scene([SceneObject(PlaneShape(ZERO, UP), stiffness, friction, damping)])


def ball(stiffness: float, damping: float | None = None, friction: FrictionCone | None = None) -> Scene:
    """Of 30 mm radius, its top at the origin."""
    return Scene([SceneObject(SphereShape((0.0, 0.0, -0.03), 0.03), stiffness, friction, damping)])


def corner(*planes: tuple[Vector, float, float | None]) -> Scene:
    """Planes through the origin: normal, stiffness, damping."""
    return Scene(
        [SceneObject(PlaneShape(ZERO, normal), stiffness, None, damping) for normal, stiffness, damping in planes]
    )


def moving(scene: Scene | None, position: Vector, velocity: Vector) -> MassState:
    """A motion with the contact force that belongs to it."""
    return MassState(position, velocity, ZERO if scene is None else contact_force(scene.touch(position), velocity))


def run(
    name: str,
    body: ControlledMass,
    make: Callable[[], Scene | None],
    position: Vector,
    velocity: Vector,
    goal: Vector,
    duration: float,
    steps: int,
) -> MassState:
    """Where a body arrives in equal steps of the integrator `name`, in a fresh scene."""
    scene = make()
    integrator = INTEGRATORS[name].build(body, scene)
    motion = moving(scene, position, velocity)
    for _ in range(steps):
        motion = integrator.advance(motion, goal, duration / steps)
    return motion


def difference(one: MassState, other: MassState, seconds: float) -> float:
    """Of position, and of velocity times `seconds` [m]."""
    far = max(abs(a - b) for a, b in zip(one.position, other.position, strict=True))
    fast = max(abs(a - b) for a, b in zip(one.velocity, other.velocity, strict=True))
    return far + fast * seconds
