"""A point mass under position control: a robot with inertia, lag and contact dynamics, and nothing else."""

from math import ceil, sqrt
from typing import Annotated

from pydantic import AfterValidator, Field, WithJsonSchema

from weberlink.geometry.vector import ZERO, Vector, is_finite
from weberlink.slave.integrators import INTEGRATORS, ControlledMass, Integrator, MassState, integration_scheme
from weberlink.slave.integrators.choice import AUTO, SUBSTEPS_MOST, chosen
from weberlink.slave.robots.contract import RobotFault, RobotReading
from weberlink.slave.robots.virtual import VirtualOptions, saturated, virtual_spec
from weberlink.slave.scenes.scene import Scene

LONGEST_GAP = 0.1  # [s] of model time per call; a longer silence is not made up for


def _check_integrator(name: str) -> str:
    if name != AUTO:
        integration_scheme(name)
    return name


IntegratorName = Annotated[
    str, AfterValidator(_check_integrator), WithJsonSchema({"enum": [AUTO, *INTEGRATORS], "type": "string"})
]


class SimulatedOptions(VirtualOptions):
    """Options of `simulated`: by default a light, stiff robot that lags by 4 ms."""

    mass_kg: float = Field(default=0.2, gt=0.0, le=1000.0)
    stiffness_n_m: float = Field(
        default=50_000.0, gt=0.0, le=1e7, description="proportional gain of its position control"
    )
    damping_n_s_m: float | None = Field(default=None, gt=0.0, description="derivative gain; critical if not given")
    integrator: IntegratorName = Field(
        default="auto", description="how its motion is solved; auto picks by stiffness, mass, damping and scene"
    )
    substeps: int | None = Field(
        default=None, ge=1, le=SUBSTEPS_MOST, description="integration steps per tick; worked out if not given"
    )


class SimulatedRobot:
    """m a = k (commanded - x) - c v + f(x, v), with the contact force f of the scene where the mass really is.

    The command is held from one reading to the next; `slave.integrators` solves the motion between them, and only the
    scheme that is used is imported.
    """

    Options = SimulatedOptions

    def __init__(self, options: SimulatedOptions, scene: Scene | None, tick_period: float) -> None:
        """Raises ValueError where the integrator that the options name would be unstable; `auto` never is."""
        self.spec = virtual_spec("simulated", options, options.stiffness_n_m, tick_period)
        self._options = options
        self._scene = scene
        self._tick_period = tick_period
        critical = 2.0 * sqrt(options.stiffness_n_m * options.mass_kg)
        damping = critical if options.damping_n_s_m is None else options.damping_n_s_m
        self._body = ControlledMass(options.mass_kg, options.stiffness_n_m, damping)
        choice = chosen(self._body, scene, tick_period, options.integrator, options.substeps)
        self.integrator = choice.integrator
        """Its name in the table of integrators."""
        self.substeps = choice.substeps
        """Integration steps per tick period."""
        self._reason = choice.reason
        self._solver: Integrator = integration_scheme(self.integrator).build(self._body, scene)
        self._commanded = options.home_m
        self._motion = MassState(options.home_m, ZERO, ZERO)
        self._reading: RobotReading | None = None

    def open(self, now: float) -> None:
        if self._scene is not None:
            self._scene.reset()
        self._solver = integration_scheme(self.integrator).build(self._body, self._scene)
        self._commanded = self._options.home_m
        self._motion = MassState(self._commanded, ZERO, ZERO)
        self._reading = RobotReading(now, self._commanded, ZERO)

    def command(self, position: Vector, now: float) -> None:  # noqa: ARG002
        if not is_finite(position):
            raise ValueError(f"simulated: commanded a position that is not finite: {position}")
        self._commanded = position

    def latest(self, now: float) -> RobotReading:
        reading = self._reading
        if reading is None:
            raise RobotFault("simulated: not open")
        if now <= reading.at:
            return reading
        elapsed = min(now - reading.at, LONGEST_GAP)
        count = max(1, ceil(elapsed / self._tick_period * self.substeps - 1e-6))
        motion, step = self._motion, elapsed / count
        for _ in range(count):
            motion = self._solver.advance(motion, self._commanded, step)
        if not is_finite(motion.position) or not is_finite(motion.velocity):
            raise RobotFault(f"simulated: the motion is not finite after the command {self._commanded}")
        self._motion = motion
        self._reading = RobotReading(now, motion.position, saturated(motion.force, self.spec.force_n))
        return self._reading

    def close(self) -> None:
        self._reading = None

    def description(self) -> str:
        """One line for a person: the integrator that was picked and why, and the lag of the position control."""
        mass, stiffness, damping = self._body
        steps = f" in {self.substeps} substeps" if self.substeps > 1 else ""
        lag_ms = 1e3 * damping / stiffness
        return f"{mass:g} kg, {self.integrator} integrator{steps} ({self._reason}), lags a ramp by {lag_ms:.1f} ms"
