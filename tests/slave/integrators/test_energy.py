"""No step gains energy while its goal is held, however harsh the trial, and nothing is ever not finite."""

from collections.abc import Sequence
from math import log10, sqrt
from random import Random

import pytest

from tests.slave.scenes.solids import SHAPES
from weberlink.geometry.vector import Vector, dot, is_finite, norm, subtract
from weberlink.slave.integrators import INTEGRATORS, ControlledMass, MassState
from weberlink.slave.integrators.problem import contact_force
from weberlink.slave.robots.simulated import chosen
from weberlink.slave.scenes.scene import FrictionCone, Scene, SceneObject, SceneState, Touch
from weberlink.slave.scenes.shape import PlaneShape, Shape

STEPS = 60
LOSING = sorted(name for name, scheme in INTEGRATORS.items() if scheme.gains_nothing)
CONES = (None, *(FrictionCone(static=s, dynamic=d) for s, d in ((0.5, 0.4), (0.8, 0.3), (2.0, 0.0))))
SOLIDS: dict[str, tuple[Shape, ...]] = {
    **{name: (shape,) for name, shape in SHAPES.items()},
    "two planes": (PlaneShape((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), PlaneShape((0.01, 0.0, 0.0), (-0.8, 0.0, 0.6))),
    "ball on a plane": (SHAPES["plane"], SHAPES["sphere"]),
}


class WatchedScene(Scene):
    """A scene whose last touches can be seen, also of a state that was gone back to."""

    def __init__(self, objects: Sequence[SceneObject]) -> None:
        super().__init__(objects)
        self.touches: tuple[Touch, ...] = ()
        self._of: dict[SceneState, tuple[Touch, ...]] = {}

    def touch(self, position: Vector) -> tuple[Touch, ...]:
        self.touches = super().touch(position)
        return self.touches

    @property
    def state(self) -> SceneState:
        state = super().state
        self._of[state] = self.touches
        return state

    def restore(self, state: SceneState) -> None:
        super().restore(state)
        self.touches = self._of.get(state, ())

    def stored(self, position: Vector) -> float:
        """Energy of the springs of contact [J]; the objects have one stiffness."""
        if self.flat:  # there a second look changes nothing, and the scene may have been set without one
            state, touches = self.state, self.touch(position)
            push = self.penetration_depth
            self.restore(state)
        else:
            touches, push = self.touches, self.penetration_depth
        drags = sum(dot(touch.drag, touch.drag) for touch in touches)
        return 0.5 * (self.stiffness_n_m * push * push + drags / self.stiffness_n_m)


def tenfold(random: Random, low: float, high: float) -> float:
    return float(10.0 ** random.uniform(log10(low), log10(high)))


def gains(seed: int, name: str | None = None) -> int:
    """How many steps of one random trial gain energy; `name` of the integrator, or None for the choice of `auto`."""
    random = Random(seed)
    solid = random.choice(sorted(SOLIDS))
    mass, stiffness = tenfold(random, 1e-6, 1e3), tenfold(random, 1e-3, 1e9)
    control = tenfold(random, 1e-3, 1e9) if random.random() < 0.5 else tenfold(random, 10.0, 1e5)
    damping = random.choice([0.0, 2.0 * sqrt(control * mass), tenfold(random, 1e-3, 1e6)])
    dashpot = random.choice([None, None, tenfold(random, 1e-3, 1e6)])
    cone, tick = random.choice(CONES), 1.0 / tenfold(random, 10.0, 1e4)
    position = (random.uniform(-0.02, 0.02), random.uniform(-0.02, 0.02), random.choice([0.045, 0.03, 0.0, -0.01]))
    speed = random.choice([0.0, 5.0])
    velocity = (random.uniform(-speed, speed), random.uniform(-speed, speed), random.uniform(-speed, speed))
    # A goal that moves past a scene at rest is a scene that moves past the goal: each step holds it.
    drift = tuple(random.choice([0.0, 0.0, 5.0]) * random.uniform(-1.0, 1.0) for _ in range(3))
    goal = tuple(random.uniform(-0.04, 0.04) for _ in range(3))

    scene = WatchedScene([SceneObject(shape, stiffness, cone, dashpot) for shape in SOLIDS[solid]])
    body = ControlledMass(mass, control, damping)
    choice = chosen(body, scene, tick, "auto") if name is None else chosen(body, scene, tick, name, 1)
    integrator, step = INTEGRATORS[choice.integrator].build(body, scene), tick / choice.substeps
    for _ in range(6):  # inside a solid the proxy takes a few looks to come to rest
        touches = scene.touch(position)
    motion, gained = MassState(position, velocity, contact_force(touches, velocity)), 0

    def energy(motion: MassState, goal: Vector) -> float:
        away, v = subtract(motion.position, goal), motion.velocity
        return 0.5 * (mass * dot(v, v) + control * dot(away, away)) + scene.stored(motion.position)

    for index in range(STEPS):
        if index % 20 == 19:
            goal = tuple(random.uniform(-0.04, 0.04) for _ in range(3))
        x, y, z = (max(-0.05, min(0.05, at + speed * tick)) for at, speed in zip(goal, drift, strict=True))
        goal = (x, y, z)
        for _ in range(choice.substeps if index < 5 else 1):
            before = energy(motion, goal)
            motion = integrator.advance(motion, goal, step)
            assert is_finite(motion.position), seed
            assert is_finite(motion.velocity), seed
            assert is_finite(motion.force), seed
            size = max(map(abs, motion.position))
            rounding = 4e-16 * size * (control * norm(subtract(motion.position, goal)) + norm(motion.force))
            gained += energy(motion, goal) > before * (1.0 + 1e-9) + rounding
    return gained


@pytest.mark.parametrize("seeds", [range(40), pytest.param(range(1000, 1400), marks=pytest.mark.hunt)], ids=str)
@pytest.mark.parametrize("name", [None, *LOSING])
def test_no_step_of_a_harsh_trial_gains_energy(name: str | None, seeds: range) -> None:
    assert {seed: count for seed in seeds if (count := gains(seed, name))} == {}
