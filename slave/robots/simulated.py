"""A point mass under position control: a robot with inertia, lag and contact dynamics."""

from collections.abc import Callable
from math import ceil, sqrt
from statistics import median
from typing import Annotated, ClassVar

from pydantic import AfterValidator, Field, WithJsonSchema

from weberlink.geometry.vector import ZERO, Vector, is_finite
from weberlink.slave.integrators import BUILT_IN, INTEGRATORS, ControlledMass, Integrator, MassState
from weberlink.slave.integrators.choice import AUTO, SUBSTEPS_MOST, chosen
from weberlink.slave.robots.computed import LONGEST_GAP, ComputedRobot
from weberlink.slave.robots.contract import RobotFault
from weberlink.slave.robots.virtual import VirtualOptions, virtual_spec
from weberlink.slave.scenes.scene import Scene

TIMED_STEPS = 31
"""Steps whose median counts: some milliseconds at most."""


def _check_integrator(name: str) -> str:
    return name if name == AUTO else INTEGRATORS.check_known(name)


IntegratorName = Annotated[
    str, AfterValidator(_check_integrator), WithJsonSchema({"enum": [AUTO, *BUILT_IN], "type": "string"})
]


class SimulatedOptions(VirtualOptions):
    """Options of `simulated`: by default a light robot, which lags by 4 ms at 2500 N/m."""

    mass_kg: float = Field(default=0.01, ge=1e-6, le=1000.0)
    damping_n_s_m: float | None = Field(
        default=None, gt=0.0, le=1e6, description="derivative gain; critical if not given"
    )
    integrator: IntegratorName = Field(
        default="auto", description="scheme of integration; auto chooses by stiffness, mass, damping and scene"
    )
    substeps: int | None = Field(
        default=None, ge=1, le=SUBSTEPS_MOST, description="integration steps per tick; computed if not given"
    )


class SimulatedRobot(ComputedRobot):
    """m a = k (commanded - x) - c v + f(x, v), with the contact force f of the scene at the position of the mass."""

    Options: ClassVar[type[SimulatedOptions]] = SimulatedOptions

    def __init__(self, options: SimulatedOptions, scene: Scene | None, tick_period: float) -> None:
        """Raises ValueError where the named integrator would be unstable; `auto` never is."""
        super().__init__(virtual_spec("simulated", options, tick_period), options.home_m)
        self._scene = scene
        self._tick_period = tick_period
        stiffness = self.spec.stiffness_n_m
        critical = 2.0 * sqrt(stiffness * options.mass_kg)
        damping = critical if options.damping_n_s_m is None else options.damping_n_s_m
        self.body = ControlledMass(options.mass_kg, stiffness, damping)
        self._named = options.integrator, options.substeps
        self.integrator, self.substeps, self._reason = chosen(self.body, scene, tick_period, *self._named)
        self._solver: Integrator
        self._motion: MassState
        self._restart()

    def measure_steps(self, stopwatch: Callable[[], float]) -> None:
        """Choose the substeps by what a step takes here and now; for a live loop, before `open`."""
        scene, edge = self._scene, self.spec.workspace_m[1][0]
        if scene is None:
            return
        grid = [edge * share for share in (0.0, -0.2, -0.5, -0.9, 0.2, 0.5, 0.9)]
        scene.touch(self._home)  # outside
        points = ((x, y, z) for x in grid for y in grid for z in grid)
        inside = next((point for point in points if scene.touch(point)), None)
        if inside is None:
            scene.reset()
            return  # nothing to press within reach: the stated constant remains
        motion, times = MassState(inside, (0.02, 0.01, 0.0), ZERO), []
        for _ in range(TIMED_STEPS):
            began = stopwatch()
            motion = self._solver.advance(motion, inside, self._tick_period)
            times.append(stopwatch() - began)
        step_s = max(median(times), 1e-6)
        self.integrator, self.substeps, self._reason = chosen(
            self.body, scene, self._tick_period, *self._named, splitting_s=step_s
        )
        self._reset()

    def _restart(self) -> None:
        self._solver = INTEGRATORS[self.integrator].build(self.body, self._scene)
        self._motion = MassState(self._home, ZERO, ZERO)

    def _reset(self) -> None:
        if self._scene is not None:
            self._scene.reset()
        self._restart()

    def _advance(self, commanded: Vector, elapsed: float) -> tuple[Vector, Vector, Vector]:
        elapsed = min(elapsed, LONGEST_GAP)
        count = max(1, ceil(elapsed / self._tick_period * self.substeps - 1e-6))
        motion, step = self._motion, elapsed / count
        for _ in range(count):
            motion = self._solver.advance(motion, commanded, step)
        if not is_finite(motion.position) or not is_finite(motion.velocity):
            raise RobotFault(f"simulated: the motion is not finite after the command {commanded}")
        self._motion = motion
        return motion.position, motion.force, ZERO

    def description(self) -> str:
        """The integrator with the reason for its choice, and the lag of the position control, in one line."""
        mass, stiffness, damping = self.body
        steps = f" in {self.substeps} substeps" if self.substeps > 1 else ""
        lag_ms = 1e3 * damping / stiffness
        return f"{mass:g} kg, {self.integrator} integrator{steps} ({self._reason}), lags a ramp by {lag_ms:.1f} ms"
