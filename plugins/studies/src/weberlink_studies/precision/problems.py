"""Test problems of the integrators: a body, surfaces, a start and goals. Fixed, so that results stay comparable.

A smooth problem starts on the surface and stays in contact. Where events are the point, they lie between ticks.
"""

from dataclasses import dataclass
from math import exp, pi, sqrt
from typing import Literal

from weberlink.geometry.vector import ZERO, Vector
from weberlink.slave.integrators import ControlledMass
from weberlink.slave.robots.simulated import SimulatedOptions, SimulatedRobot
from weberlink.slave.scenes.scene import FrictionCone, Scene, SceneObject
from weberlink.slave.scenes.shape import PlaneShape, SphereShape

TICK = 1e-3  # tick of the recommendation and of the errors [s]

Quantity = Literal["position", "force"]


@dataclass(frozen=True)
class HalfSpace:
    """A solid below the plane through `point` [m] with the outward unit `normal`."""

    point: Vector
    normal: Vector


@dataclass(frozen=True)
class Ball:
    """A solid within `radius` [m] of `center` [m]; outside of it with `hollow`."""

    center: Vector
    radius: float
    hollow: bool = False


@dataclass(frozen=True)
class CoulombFriction:
    """Coulomb coefficients of the god-object; sliding ends below the share `restick` of the dynamic cone."""

    static: float
    dynamic: float
    restick: float = 0.5


@dataclass(frozen=True)
class ProblemSurface:
    """A solid with the contact force max(0, stiffness depth + damping d(depth)/dt) along its normal."""

    solid: HalfSpace | Ball
    stiffness: float
    damping: float = 0.0
    friction: CoulombFriction | None = None


@dataclass(frozen=True)
class Problem:
    """One body and some surfaces."""

    name: str  # snake_case, stable
    about: str  # the difficulty in a few words
    body: ControlledMass  # mass [kg], stiffness [N/m], damping [N s/m] of m a = k (goal - x) - c v + f
    surfaces: tuple[ProblemSurface, ...]  # any number of half-spaces, or one ball
    # times [s] and positions [m] of the goals; the first at 0, the others at multiples of the coarsest step
    goals: tuple[tuple[float, Vector], ...]
    position: Vector  # at the start [m]; not inside a surface
    velocity: Vector = ZERO  # at the start [m/s]
    duration: float = 0.1  # [s], a whole number of ticks
    coarsest_ticks: int = 4  # the largest step, in ticks
    # quantities without kink or jump after the start, whose order of convergence is fitted
    smooth: frozenset[Quantity] = frozenset()
    linear: bool = True  # whether the forces are linear in position and velocity between touch and release

    def goal(self, at: float) -> Vector:
        """The goal at the time `at` [s]."""
        current = self.goals[0][1]
        for since, goal in self.goals:
            if since > at + 1e-9:
                break
            current = goal
        return current

    def scene(self) -> Scene:
        """A fresh scene of the surfaces."""
        return Scene([scene_object(surface) for surface in self.surfaces])


def scene_object(surface: ProblemSurface) -> SceneObject:
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
        FrictionCone(static=friction.static, dynamic=friction.dynamic) if friction is not None else None,
        surface.damping if surface.damping > 0.0 else None,
    )


UP = (0.0, 0.0, 1.0)
BOTH: frozenset[Quantity] = frozenset({"position", "force"})
ROBOT = SimulatedRobot(SimulatedOptions(), None, TICK).body  # the simulated robot of a configuration without options


def floor(
    stiffness: float, damping: float = 0.0, height: float = 0.0, friction: CoulombFriction | None = None
) -> ProblemSurface:
    return ProblemSurface(HalfSpace((0.0, 0.0, height), UP), stiffness, damping, friction)


def grazing() -> Problem:
    """An underdamped body turns exactly at the floor: z = goal - (start - goal) exp(-pi zeta / sqrt(1 - zeta^2))."""
    body = ControlledMass(mass=0.5, stiffness=2000.0, damping=10.0)
    start, goal = 0.010, 0.005
    zeta = body.damping / (2.0 * sqrt(body.stiffness * body.mass))
    lowest = goal - (start - goal) * exp(-pi * zeta / sqrt(1.0 - zeta * zeta))
    return Problem(
        "grazing", "clearance touches zero tangentially, 1e5 N/m", body, (floor(1e5, height=lowest),),
        ((0.0, (0.0, 0.0, goal)),), (0.0, 0.0, start), duration=0.1,
    )  # fmt: skip


PROBLEMS: tuple[Problem, ...] = (
    Problem(
        "soft_wall", "500 N/m, contact from the start",
        ROBOT, (floor(500.0),), ((0.0, (0.0, 0.0, -0.01)),), (0.0, 0.0, 0.0), (0.0, 0.0, -0.1), duration=0.064,
        smooth=BOTH,
    ),
    Problem(
        "wall_1e5", "1e5 N/m, contact from the start",
        ROBOT, (floor(1e5),), ((0.0, (0.0, 0.0, -0.006)),), (0.0, 0.0, 0.0), (0.0, 0.0, -0.05), duration=0.064,
        smooth=BOTH,
    ),
    Problem(
        "wall_1e7", "1e7 N/m, touched at 0.3 m/s, bounces",
        ROBOT, (floor(1e7),), ((0.0, (0.0, 0.0, -0.001)),), (0.0, 0.0, 0.0013), (0.0, 0.0, -0.3), duration=0.064,
    ),
    Problem(
        "light_1g", "1 g on 2000 N/m, contact from the start",
        ControlledMass(mass=0.001, stiffness=500.0, damping=1.4), (floor(2000.0),), ((0.0, (0.0, 0.0, -0.005)),),
        (0.0, 0.0, 0.0), (0.0, 0.0, -0.5), duration=0.064, smooth=BOTH,
    ),
    Problem(
        "heavy_10kg", "10 kg falls onto 1e5 N/m and rebounds",
        ControlledMass(mass=10.0, stiffness=50_000.0, damping=100.0), (floor(1e5),), ((0.0, (0.0, 0.0, -0.001)),),
        (0.0, 0.0, 0.0053), duration=0.128,
    ),
    Problem(
        "overdamped", "1e5 N/m with 2e4 N s/m: time constants 0.5 us and 0.2 s",
        ROBOT, (floor(1e5, 2e4),), ((0.0, (0.0, 0.0, -0.03)),), (0.0, 0.0, 0.0), (0.0, 0.0, -0.05), duration=0.064,
    ),
    Problem(
        "impact_2m_s", "2 m/s into 2e4 N/m with 30 N s/m: the force jumps",
        ControlledMass(mass=0.2, stiffness=2000.0, damping=10.0), (floor(2e4, 30.0),),
        ((0.0, (0.0, 0.0, -0.001)), (0.032, (0.0, 0.0, 0.006))), (0.0, 0.0, 0.0047), (0.0, 0.0, -2.0), duration=0.064,
    ),
    grazing(),
    Problem(
        "stick_slip", "friction 0.8 / 0.3, dragged by a soft drive in steps",
        ControlledMass(mass=0.05, stiffness=2000.0, damping=4.0),
        (floor(5000.0, friction=CoulombFriction(static=0.8, dynamic=0.3)),),
        ((0.0, (0.0, 0.0, -0.002)), (0.024, (0.001, 0.0, -0.002)), (0.036, (0.0022, 0.0, -0.002)),
         (0.068, (0.0038, 0.0, -0.002)), (0.096, (0.001, 0.0, -0.002))),
        (0.0, 0.0, 0.0004), duration=0.128, linear=False,
    ),
    Problem(
        "rough_1e6", "friction 0.8 / 0.3 on 1e6 N/m",
        ControlledMass(mass=0.2, stiffness=5000.0, damping=50.0),
        (floor(1e6, friction=CoulombFriction(static=0.8, dynamic=0.3)),),
        ((0.0, (0.0, 0.0, -0.002)), (0.024, (0.003, 0.0, -0.002)), (0.052, (0.0, 0.0, -0.002))), (0.0, 0.0, 0.0004),
        duration=0.08, linear=False,
    ),
    Problem(
        "sphere", "slides over a ball of 20 mm, 2e4 N/m",
        ControlledMass(mass=0.2, stiffness=5000.0, damping=30.0), (ProblemSurface(Ball((0.0, 0.0, -0.02), 0.02), 2e4),),
        ((0.0, (0.006, 0.003, -0.004)),), (0.0, 0.0, 0.0), (0.05, 0.0, -0.2), duration=0.064, smooth=BOTH,
        linear=False,
    ),
    Problem(
        "hollow", "slides in a hollow of 30 mm, 2e4 N/m",
        ControlledMass(mass=0.2, stiffness=5000.0, damping=30.0),
        (ProblemSurface(Ball((0.0, 0.0, 0.03), 0.03, hollow=True), 2e4),), ((0.0, (0.006, 0.003, -0.004)),),
        (0.0, 0.0, 0.0), (0.05, 0.0, -0.2), duration=0.064, smooth=BOTH, linear=False,
    ),
    Problem(
        "hollow_1e6", "bounces along a hollow of 30 mm, 1e6 N/m",
        ControlledMass(mass=0.2, stiffness=5000.0, damping=30.0),
        (ProblemSurface(Ball((0.0, 0.0, 0.03), 0.03, hollow=True), 1e6),), ((0.0, (0.006, 0.003, -0.004)),),
        (0.0, 0.0, 0.0), (0.05, 0.0, -0.2), duration=0.064, linear=False,
    ),
    Problem(
        "corner", "floor and wall at right angles, both from the start",
        ROBOT, (floor(2e4), ProblemSurface(HalfSpace((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), 5e4, 20.0)),
        ((0.0, (-0.003, 0.001, -0.004)),), (0.0, 0.0, 0.0), (-0.1, 0.0, -0.1), duration=0.064, smooth=BOTH,
    ),
    Problem(
        "oblique", "floor, then a wall at 120 degrees to it",
        ControlledMass(mass=0.2, stiffness=5000.0, damping=30.0),
        (floor(2e4), ProblemSurface(HalfSpace((0.003, 0.0, 0.0), (-sqrt(0.75), 0.0, 0.5)), 3e4)),
        ((0.0, (0.01, 0.001, -0.004)),), (0.0, 0.0, 0.0011), duration=0.064,
    ),
)  # fmt: skip
