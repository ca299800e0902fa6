"""Error and run time of one integrator with one step."""

import gc
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite
from statistics import median_low
from time import process_time

from weberlink.geometry.vector import ZERO, Vector, distance, dot, is_finite, scale, subtract
from weberlink.slave.integrators import IntegrationScheme, MassState
from weberlink.slave.integrators.problem import stored_energy
from weberlink_studies.frame import Row
from weberlink_studies.precision.problems import TICK, Problem
from weberlink_studies.precision.reference import ReferenceSolution

DIVERGED = 1.0  # position error, relative to the extent of the motion, from which a run counts as diverged
ENOUGH = 0.1  # CPU time [s] after which a run is not repeated again: a long run needs no average


@dataclass(frozen=True, order=True)
class StepSize:
    """A step of `ticks` ticks, or of a tick divided into `substeps`; one of the two is 1."""

    ticks: int = 1
    substeps: int = 1

    @property
    def length(self) -> float:
        return TICK * self.ticks / self.substeps


def measured(
    problem: Problem, name: str, scheme: IntegrationScheme, step: StepSize, known: ReferenceSolution, repeats: int
) -> Row:
    """Run it up to `repeats` times and compare it with the reference.

    Errors are the largest over the ticks, relative to the extent of the motion or to the largest contact force; None
    where the motion is not finite. `energy_gained` is the sum of the rises of the energy of motion, control and contact
    in single ticks, each with its goal held, relative to the largest energy. Run times are CPU times, the median of the
    repeats (the lower one of two) and (largest - smallest) / median.
    """
    times: list[float] = []
    motions: list[MassState] = []
    while len(times) < repeats and sum(times) * problem.duration < ENOUGH:
        motions, seconds = simulated(problem, scheme, step, known.start_force)
        times.append(seconds / problem.duration)
    stride = slice(step.ticks - 1, None, step.ticks)
    away = largest_error([motion.position for motion in motions], known.trajectory.positions[stride])
    off = largest_error([motion.force for motion in motions], known.trajectory.forces[stride])
    gained = energy_gained(problem, motions, known.start_force, step.ticks)
    middle = median_low(times)
    return {
        "problem": problem.name,
        "integrator": name,
        "step_us": 1e6 * step.length,
        "substeps_per_tick": step.substeps if step.ticks == 1 else 1.0 / step.ticks,
        "position_error": finite_or_none(away / known.position_scale),
        "force_error": finite_or_none(off / known.force_scale),
        "position_error_m": finite_or_none(away),
        "force_error_n": finite_or_none(off),
        "energy_gained": finite_or_none(gained),
        "run_time_ms_per_s": 1e3 * middle,
        "run_time_spread": (max(times) - min(times)) / middle if middle > 0.0 else 0.0,
        "repeats": len(times),
        "diverged": not away / known.position_scale <= DIVERGED,
    }


def finite_or_none(value: float) -> float | None:
    return value if isfinite(value) else None


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
