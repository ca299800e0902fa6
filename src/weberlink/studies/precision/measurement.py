"""Error and run time of one integrator with one step; orders of convergence; the Pareto front."""

import gc
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite, log
from statistics import median_low
from time import process_time
from typing import Any

from weberlink.geometry.vector import ZERO, Vector, distance, dot, is_finite, scale, subtract
from weberlink.slave.integrators.contact_force import stored_energy
from weberlink.slave.integrators.contract import IntegrationScheme, MassState
from weberlink.studies.precision.problems import TICK, Problem
from weberlink.studies.precision.reference import ReferenceSolution

DIVERGED = 1.0
"""Position error, relative to the extent of the motion, from which a run counts as diverged."""
ENOUGH = 0.1
"""CPU time [s] after which a run is not repeated again: a long run needs no average."""
COARSE = 0.03
"""Relative errors above it are not asymptotic yet."""
POINTS_LEAST = 3
POINTS_MOST = 4

Point = tuple[float, float]
"""Two figures to be small, such as run time and error; infinite where there is none."""


@dataclass(frozen=True, order=True)
class StepSize:
    """A step of `ticks` ticks, or of a tick divided into `substeps`; one of the two is 1."""

    ticks: int = 1
    substeps: int = 1

    @property
    def length(self) -> float:
        return TICK * self.ticks / self.substeps

    @property
    def fits_tick(self) -> bool:
        """Whether a loop at the tick rate can take it."""
        return self.ticks == 1


@dataclass(frozen=True)
class IntegratorRow:
    """One integrator on one problem with one step. Errors are the largest over the ticks; infinite if not finite."""

    problem: str
    integrator: str
    step: StepSize
    position_error: float
    """Relative to the extent of the motion."""
    force_error: float
    """Relative to the largest contact force."""
    position_error_m: float
    force_error_n: float
    energy_gained: float
    """Sum of what the energy of motion, control and contact rises by in single ticks, each with its goal held, relative
    to the largest energy; infinite if not finite."""
    run_time: float
    """CPU time per simulated second [s], median of the repeats (the lower one of two)."""
    run_time_spread: float
    """(largest - smallest) / median of the repeats."""
    repeats: int

    @property
    def diverged(self) -> bool:
        return not self.position_error <= DIVERGED

    def as_json(self) -> dict[str, Any]:
        return {
            "problem": self.problem,
            "integrator": self.integrator,
            "step_us": 1e6 * self.step.length,
            "substeps_per_tick": self.step.substeps if self.step.fits_tick else 1.0 / self.step.ticks,
            "position_error": finite_or_none(self.position_error),
            "force_error": finite_or_none(self.force_error),
            "position_error_m": finite_or_none(self.position_error_m),
            "force_error_n": finite_or_none(self.force_error_n),
            "energy_gained": finite_or_none(self.energy_gained),
            "run_time_ms_per_s": 1e3 * self.run_time,
            "run_time_spread": self.run_time_spread,
            "repeats": self.repeats,
            "diverged": self.diverged,
        }


def finite_or_none(value: float) -> float | None:
    return value if isfinite(value) else None


def measured(
    problem: Problem, name: str, scheme: IntegrationScheme, step: StepSize, known: ReferenceSolution, repeats: int
) -> IntegratorRow:
    """Run it up to `repeats` times and compare it with the reference."""
    times: list[float] = []
    motions: list[MassState] = []
    while len(times) < repeats and sum(times) * problem.duration < ENOUGH:
        motions, seconds = simulated(problem, scheme, step, known.start_force)
        times.append(seconds / problem.duration)
    stride = step.ticks
    positions = [motion.position for motion in motions]
    forces = [motion.force for motion in motions]
    position_error_m = largest_error(positions, known.trajectory.positions[stride - 1 :: stride])
    force_error_n = largest_error(forces, known.trajectory.forces[stride - 1 :: stride])
    middle = median_low(times)
    return IntegratorRow(
        problem=problem.name,
        integrator=name,
        step=step,
        position_error=position_error_m / known.position_scale,
        force_error=force_error_n / known.force_scale,
        position_error_m=position_error_m,
        force_error_n=force_error_n,
        energy_gained=energy_gained(problem, motions, known.start_force, stride),
        run_time=middle,
        run_time_spread=(max(times) - min(times)) / middle if middle > 0.0 else 0.0,
        repeats=len(times),
    )


def simulated(
    problem: Problem, scheme: IntegrationScheme, step: StepSize, start_force: Vector
) -> tuple[list[MassState], float]:
    """The motion after each tick (or step, if that is longer), and the CPU time [s] of integrating it."""
    integrator = scheme.build(problem.body, problem.scene())
    motion = MassState(problem.position, problem.velocity, start_force)
    blocks = round(problem.duration / TICK) // step.ticks
    goals = [problem.goal(block * step.ticks * TICK) for block in range(blocks)]
    length, substeps, advance = step.length, range(step.substeps), integrator.advance
    motions: list[MassState] = []
    collecting = gc.isenabled()
    gc.disable()
    try:
        began = process_time()
        for goal in goals:
            for _ in substeps:
                motion = advance(motion, goal, length)
            motions.append(motion)
        return motions, process_time() - began
    finally:
        if collecting:
            gc.enable()


def largest_error(values: list[Vector], expected: list[Vector]) -> float:
    """The largest distance; infinite if any value is not finite."""
    worst = 0.0
    for value, right in zip(values, expected, strict=True):
        if not is_finite(value):
            return inf
        worst = max(worst, distance(value, right))
    return worst


def energy_gained(problem: Problem, motions: Sequence[MassState], start_force: Vector, ticks: int) -> float:
    """The sum of the rises of energy over each of `motions`, which are `ticks` apart, relative to the largest energy.

    What the springs of contact hold follows from the positions, and that of friction from the force along the surface.
    """
    scene, mass, control = problem.scene(), problem.body.mass, problem.body.stiffness
    gained = largest = 0.0
    before, contact = MassState(problem.position, problem.velocity, start_force), 0.0
    for index, motion in enumerate(motions):
        if not (is_finite(motion.position) and is_finite(motion.velocity) and is_finite(motion.force)):
            return inf
        goal, held = problem.goal(index * ticks * TICK), contact
        touches = [touch._replace(drag=ZERO) for touch in scene.touch(motion.position)]
        contact = stored_energy(touches, scene.penetration_depth)
        if scene.rubs and touches:
            n = touches[0].normal
            along = subtract(motion.force, scale(n, dot(n, motion.force)))
            contact += 0.5 * dot(along, along) / touches[0].stiffness
        energies = []
        for (position, velocity, _), stored in ((before, held), (motion, contact)):
            away = subtract(position, goal)
            energies.append(0.5 * (mass * dot(velocity, velocity) + control * dot(away, away)) + stored)
        if not isfinite(max(energies)):
            return inf
        gained, largest = gained + max(0.0, energies[1] - energies[0]), max(largest, *energies)
        before = motion
    return gained / largest if largest > 0.0 else 0.0


def fitted_order(steps: Sequence[float], errors: Sequence[float | None], floor: float) -> float | None:
    """Least squares over the finest four of the steps whose errors are asymptotic.

    Args:
        steps: lengths, in any order and unit.
        errors: relative; None where the run diverged.
        floor: errors below it are rounding, or the reference's own.

    Returns:
        The order; None where fewer than three errors lie between `floor` and 3 %.
    """
    usable = [
        (log(step), log(error))
        for step, error in sorted(zip(steps, errors, strict=True), key=lambda pair: pair[0])
        if error is not None and floor < error < COARSE
    ][:POINTS_MOST]
    if len(usable) < POINTS_LEAST:
        return None
    mean_x = sum(x for x, _ in usable) / len(usable)
    mean_y = sum(y for _, y in usable) / len(usable)
    covariance = sum((x - mean_x) * (y - mean_y) for x, y in usable)
    return covariance / sum((x - mean_x) ** 2 for x, _ in usable)


def dominates(a: Point, b: Point) -> bool:
    """Whether neither figure of `a` is larger than that of `b`, and one is smaller."""
    return a[0] <= b[0] and a[1] <= b[1] and a != b


def front(points: Sequence[Point]) -> list[bool]:
    """Whether each point is on the Pareto front: finite, and dominated by no other."""
    return [isfinite(point[1]) and not any(dominates(other, point) for other in points) for point in points]


def best_in_time(points: Sequence[Point], time: float) -> int | None:
    """The index of the point with the smallest second figure whose first one is at most `time`."""
    quick = [index for index, point in enumerate(points) if point[0] <= time]
    return min(quick, key=lambda index: points[index][1], default=None)
