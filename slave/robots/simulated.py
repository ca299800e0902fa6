"""A point mass under position control: a robot with inertia, lag and contact dynamics, and nothing else."""

from math import ceil, sqrt

from pydantic import Field

from codec.vector import ZERO, Vector, is_finite
from slave.robots.contract import RobotFault, RobotReading
from slave.robots.virtual import VirtualOptions, saturated, virtual_spec
from slave.scenes.scene import Scene

LONGEST_GAP = 0.1  # [s] of model time per call; a longer silence is not made up for
STEP_ANGLE = 0.2  # largest omega h and largest c h / m per substep
SUBSTEPS_MOST = 64


class SimulatedOptions(VirtualOptions):
    """Options of `simulated`: by default a light, stiff robot that lags by 4 ms."""

    mass_kg: float = Field(default=0.2, gt=0.0, le=1000.0)
    stiffness_n_m: float = Field(
        default=50_000.0, gt=0.0, le=1e7, description="proportional gain of its position control"
    )
    damping_n_s_m: float | None = Field(default=None, gt=0.0, description="derivative gain; critical if not given")


class SimulatedRobot:
    """m a = k (commanded - x) - c v + f(x), with the contact force f of the scene where the mass really is.

    Integrated by semi-implicit Euler, v before x. With b = (k + k_scene) h^2 / m and a = (c + c_scene) h / m it is
    stable while 2 a + b < 4. The step is chosen far below that, for accuracy: sqrt(b) <= 0.2 and a <= 0.2, so

        substeps = ceil(T max(sqrt((k + k_scene) / m), (c + c_scene) / m) / 0.2)

    A choice of constants that needs more than 64 substeps a tick runs with 64 where that is still stable, and is
    refused where it is not.
    """

    Options = SimulatedOptions

    def __init__(self, options: SimulatedOptions, scene: Scene | None, tick_period: float) -> None:
        """Raises ValueError where no step that fits a tick would be stable."""
        self.spec = virtual_spec("simulated", options, options.stiffness_n_m, tick_period)
        self._options = options
        self._scene = scene
        self._tick_period = tick_period
        self._mass = options.mass_kg
        self._stiffness = options.stiffness_n_m
        critical = 2.0 * sqrt(options.stiffness_n_m * options.mass_kg)
        self._damping = critical if options.damping_n_s_m is None else options.damping_n_s_m
        self.substeps = self._chosen_substeps()
        """Integration steps per tick period."""
        self._commanded = options.home_m
        self._velocity = ZERO
        self._force = ZERO
        self._reading: RobotReading | None = None

    def open(self, now: float) -> None:
        if self._scene is not None:
            self._scene.reset()
        self._commanded = self._options.home_m
        self._velocity = self._force = ZERO
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
        position = self._advance(reading.position, count, elapsed / count)
        if not is_finite(position):
            raise RobotFault(f"simulated: the position is not finite after the command {self._commanded}")
        self._reading = RobotReading(now, position, saturated(self._force, self.spec.force_n))
        return self._reading

    def close(self) -> None:
        self._reading = None

    def description(self) -> str:
        """One line for a person: the step that was picked, and the lag of the position control."""
        step_us = 1e6 * self._tick_period / self.substeps
        lag_ms = 1e3 * self._damping / self._stiffness
        return (
            f"{self._mass:g} kg, {self.substeps} substeps of {step_us:.0f} us per tick, lags a ramp by {lag_ms:.1f} ms"
        )

    def _advance(self, position: Vector, count: int, step: float) -> Vector:
        x, y, z = position
        u, v, w = self._velocity
        goal_x, goal_y, goal_z = self._commanded
        stiffness, damping, gain = self._stiffness, self._damping, step / self._mass
        force = self._force
        for _ in range(count):
            u += gain * (stiffness * (goal_x - x) - damping * u + force[0])
            v += gain * (stiffness * (goal_y - y) - damping * v + force[1])
            w += gain * (stiffness * (goal_z - z) - damping * w + force[2])
            x, y, z = x + step * u, y + step * v, z + step * w
            if self._scene is not None:
                force = self._scene.force((x, y, z), step)
        self._velocity, self._force = (u, v, w), force
        return (x, y, z)

    def _chosen_substeps(self) -> int:
        stiffness = self._stiffness + (self._scene.stiffness_n_m if self._scene is not None else 0.0)
        damping = self._damping + (self._scene.damping_n_s_m if self._scene is not None else 0.0)
        fastest = max(sqrt(stiffness / self._mass), damping / self._mass)
        wanted = max(1, ceil(self._tick_period * fastest / STEP_ANGLE))
        if wanted <= SUBSTEPS_MOST:
            return wanted
        step = self._tick_period / SUBSTEPS_MOST
        if 2.0 * damping * step / self._mass + stiffness * step * step / self._mass < 4.0:
            return SUBSTEPS_MOST
        raise ValueError(
            f"mass_kg: {self._mass:g} kg against {stiffness:g} N/m and {damping:g} N s/m is unstable even with "
            f"{SUBSTEPS_MOST} substeps of a {self._tick_period:g} s tick; expected more mass or lower gains"
        )
