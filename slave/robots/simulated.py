"""A point mass under position control: a robot with inertia, lag and contact dynamics."""

from collections.abc import Callable
from math import ceil, sqrt
from statistics import median
from typing import Annotated, ClassVar, NamedTuple

from pydantic import Field, WithJsonSchema, field_validator

from weberlink.geometry.vector import ZERO, Vector, is_finite, within
from weberlink.slave.integrators import BUILT_IN, INTEGRATORS, ControlledMass, Integrator, MassState
from weberlink.slave.robots.computed import LONGEST_GAP, ComputedRobot
from weberlink.slave.robots.contract import RobotFault
from weberlink.slave.robots.virtual import VirtualOptions, virtual_spec
from weberlink.slave.scenes.scene import Scene

AUTO = "auto"
STEP_ANGLE = 0.2  # largest omega h and largest c h / m of a semi-implicit substep, for accuracy
SUBSTEPS_MOST = 64
BUDGET = 0.15  # Share of a tick for integration: network, codec, control and the jitter of the host need the rest
# Stated time of a step of the exact scheme on tangent planes; `study precision` measures 54 to 64 us (2-core VM).
# A run in virtual time must not depend on the machine and keeps this constant; a live daemon measures its own.
SPLITTING_S = 60e-6
TIMED_STEPS = 31  # Steps whose median counts: some milliseconds at most


class SimulatedOptions(VirtualOptions):
    """Options of `simulated`: by default a light robot, which lags by 4 ms at 2500 N/m."""

    mass_kg: float = Field(default=0.01, ge=1e-6, le=1000.0)
    damping_n_s_m: float | None = Field(
        default=None, gt=0.0, le=1e6, description="derivative gain; critical if not given"
    )
    integrator: Annotated[str, WithJsonSchema({"enum": [AUTO, *BUILT_IN], "type": "string"})] = Field(
        default=AUTO, description="scheme of integration; auto chooses by stiffness, mass, damping and scene"
    )
    substeps: int | None = Field(
        default=None, ge=1, le=SUBSTEPS_MOST, description="integration steps per tick; computed if not given"
    )

    @field_validator("integrator")
    @classmethod
    def check_integrator(cls, name: str) -> str:
        return name if name == AUTO else INTEGRATORS.check_known(name)


class SimulatedRobot(ComputedRobot):
    """m a = k (commanded - x) - c v + f(x, v), with the contact force f of the scene at the position of the mass."""

    Options: ClassVar[type[SimulatedOptions]] = SimulatedOptions

    def __init__(self, options: SimulatedOptions, scene: Scene | None, tick_period: float) -> None:
        """Raises ValueError where the named integrator would be unstable; `auto` never is."""
        super().__init__(virtual_spec("simulated", options, tick_period), options.home_m)
        self._scene = scene = scene or Scene([])
        self._tick_period = tick_period
        stiffness = self.spec.stiffness_n_m
        critical = 2.0 * sqrt(stiffness * options.mass_kg)
        damping = critical if options.damping_n_s_m is None else options.damping_n_s_m
        self.body = ControlledMass(options.mass_kg, stiffness, damping)
        self._named = options.integrator, options.substeps
        self.integrator, self.substeps, self._reason = chosen(self.body, scene, tick_period, *self._named)
        self._solver: Integrator
        self._motion: MassState
        self._reset()

    def measure_steps(self, stopwatch: Callable[[], float]) -> None:
        """Choose the substeps by what a step takes here and now; for a live loop, before `open`."""
        scene, edge = self._scene, self.spec.workspace_m[1][0]
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

    def _reset(self) -> None:
        self._scene.reset()
        self._solver = INTEGRATORS[self.integrator].build(self.body, self._scene)
        self._motion = MassState(self._home, ZERO, ZERO)

    def _advance(self, commanded: Vector, elapsed: float) -> tuple[Vector, Vector, Vector]:
        elapsed = min(elapsed, LONGEST_GAP)
        count = max(1, ceil(elapsed / self._tick_period * self.substeps - 1e-6))
        motion, step = self._motion, elapsed / count
        for _ in range(count):
            motion = self._solver.advance(motion, commanded, step)
        if not is_finite(motion.position) or not is_finite(motion.velocity):
            raise RobotFault(f"simulated: the motion is not finite after the command {commanded}")
        self._motion = motion
        return motion.position, within(motion.force, self.spec.force_n), ZERO

    def description(self) -> str:
        """The integrator with the reason for its choice, and the lag of the position control, in one line."""
        mass, stiffness, damping = self.body
        steps = f" in {self.substeps} substeps" if self.substeps > 1 else ""
        lag_ms = 1e3 * damping / stiffness
        return f"{mass:g} kg, {self.integrator} integrator{steps} ({self._reason}), lags a ramp by {lag_ms:.1f} ms"


class IntegratorChoice(NamedTuple):
    """A name in the table of integrators, steps per tick, and the reason in a few words."""

    integrator: str
    substeps: int
    reason: str


def chosen(
    body: ControlledMass,
    scene: Scene | None,
    period: float,
    integrator: str = AUTO,
    substeps: int | None = None,
    splitting_s: float = SPLITTING_S,
) -> IntegratorChoice:
    """The integrator of this name; for `auto` the one with the best error within the budget that gains no energy.

    That is `exact`. Where contact has a closed form one step is the solution. Elsewhere its error falls as the square
    of the step, so the budget, a share of the tick, is filled with substeps, at most as many as semi-implicit ones
    would resolve the motion. The implicit scheme costs more and resolves less, and the semi-implicit one, though
    cheaper, gains energy within each swing: they are for comparison, and the implicit one for the steps that `exact`
    cannot take.

    A semi-implicit substep resolves omega h <= 0.2 and c h / m <= 0.2, hence, with the time `period` between two ticks,

        substeps = ceil(period max(sqrt((k + k_scene) / m), (c + c_scene) / m) / 0.2)

    `splitting_s` is the time of a step of the exact scheme where contact has no closed form. Raises ValueError if the
    semi-implicit scheme was named and would be unstable, or an object of the scene moves.
    """
    scene = scene or Scene([])
    if scene.moves:
        raise ValueError(
            "scene: a robot with a mass cannot touch an object with motion (no integrator knows the velocity of its "
            "surface); expected robot: {driver: point}, or objects without motion"
        )
    stiffness, damping = body.stiffness + scene.stiffness_n_m, body.damping + scene.damping_n_s_m
    angle = period * max(sqrt(stiffness / body.mass), damping / body.mass)
    resolving = max(1, ceil(angle / STEP_ANGLE))
    told = f"{stiffness:.3g} N/m is {period * sqrt(stiffness / body.mass):.2g} rad per tick"
    if integrator == AUTO:
        if not scene.objects:
            return IntegratorChoice("exact", substeps or 1, "no contact")
        if scene.closed_form:
            what = "friction on a flat face" if scene.rubs else "flat contact"
            return IntegratorChoice("exact", substeps or 1, f"{what}, {told}")
        fitting = int(BUDGET * period / splitting_s)
        what = "curved contact" if not scene.flat else "friction with damping or on several faces"
        over = "" if fitting else f", {1e6 * splitting_s:.0f} us a step is over the budget"
        count = substeps or max(1, min(resolving, fitting, SUBSTEPS_MOST))
        return IntegratorChoice("exact", count, f"{what}, {told}{over}")
    if integrator != "semi_implicit":
        return IntegratorChoice(integrator, substeps or 1, f"as named, {told}")
    count = substeps or min(resolving, SUBSTEPS_MOST)
    step = period / count
    if 2.0 * damping * step / body.mass + stiffness * step * step / body.mass >= 4.0:
        more = f"substeps: {resolving}, or " if count < resolving <= SUBSTEPS_MOST else ""
        raise ValueError(
            f"integrator: semi_implicit is unstable in {count} substeps of a {period:g} s tick for {body.mass:g} kg "
            f"against {stiffness:g} N/m and {damping:g} N s/m; expected {more}integrator: auto (which cannot be "
            "unstable), implicit or exact"
        )
    return IntegratorChoice(integrator, count, f"as named, {told}")
