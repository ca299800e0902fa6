"""Reference solutions: each problem solved by two independent solvers from event to event, and their agreement.

Needs scipy (extra: studies).
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Any

from weberlink.geometry.vector import Vector, distance, norm
from weberlink_studies.precision.equations import MotionState, Phase, beginning, rate
from weberlink_studies.precision.problems import TICK, HalfSpace, Problem
from weberlink_studies.precision.solvers import Solver, Stretch, closed_form, dop853, lsoda

AGREEMENT = 1e-9  # largest difference between the solvers, relative to the scales of the problem
EVENTS_MOST = 10_000


@dataclass(frozen=True)
class Trajectory:
    """Position [m] and contact force [N] at every tick after the start."""

    positions: list[Vector]
    forces: list[Vector]
    events: int  # touches, releases, slips and stops


@dataclass(frozen=True)
class ReferenceSolution:
    """The solution of a problem, at every tick."""

    trajectory: Trajectory
    start_force: Vector  # contact force just after the start [N]
    position_scale: float  # largest distance from the start [m], the unit of relative position errors
    force_scale: float
    """Largest contact force [N]; without contact, stiffness of the position control times `position_scale`."""
    agreement: float  # largest difference between the two solvers, in position or force, relative to the scales

    def as_json(self) -> dict[str, Any]:
        return {
            "reference_agreement": self.agreement,
            "agrees": self.agreement <= AGREEMENT,
            "events": self.trajectory.events,
            "position_scale_m": self.position_scale,
            "force_scale_n": self.force_scale,
        }


def solvers(problem: Problem) -> dict[str, Solver]:
    """Two independent solvers of a problem."""
    flat = all(isinstance(surface.solid, HalfSpace) for surface in problem.surfaces)
    return {"dop853": dop853, **({"closed_form": closed_form} if flat else {"lsoda": lsoda})}


def reference(problem: Problem) -> ReferenceSolution:
    """Solve `problem` with both solvers."""
    first, second = (trajectory(problem, solver) for solver in solvers(problem).values())
    extent = max(distance(position, problem.position) for position in first.positions)
    force = max(norm(f) for f in first.forces) or problem.body.stiffness * extent
    position_scale, force_scale = extent or 1.0, force or 1.0
    differences = [distance(a, b) / position_scale for a, b in zip(first.positions, second.positions, strict=True)]
    differences += [distance(a, b) / force_scale for a, b in zip(first.forces, second.forces, strict=True)]
    agreement = max(differences) if first.events == second.events else inf
    return ReferenceSolution(first, start_force(problem), position_scale, force_scale, agreement)


def start_force(problem: Problem) -> Vector:
    """Contact force of a body that starts on a surface and moves into it."""
    just_inside = [x + 1e-12 * v for x, v in zip(problem.position, problem.velocity, strict=True)]
    phase, _ = settled(beginning(problem), [*just_inside, *problem.velocity])
    return phase.force([*problem.position, *problem.velocity])


def settled(phase: Phase, state: MotionState) -> tuple[Phase, int]:
    """The phase that lasts from this state on, and the number of events that lead to it."""
    for events in range(EVENTS_MOST):
        fallen = [guard for guard in phase.guards if guard.value(state) < 0.0]
        if not fallen:
            return phase, events
        phase = fallen[0].successor(state)
    raise ArithmeticError(f"no phase of motion lasts at {state}")


def trajectory(problem: Problem, solver: Solver) -> Trajectory:
    """The motion by one solver."""
    positions: list[Vector] = []
    forces: list[Vector] = []
    now, events = 0.0, 0
    state: MotionState = [*problem.position, *problem.velocity]
    phase = beginning(problem)
    ticks = [(n + 1) * TICK for n in range(round(problem.duration / TICK))]
    ends = [since for since, _ in problem.goals[1:]] + [ticks[-1]]
    for end in ends:
        goal = problem.goal(now)
        while now < end:
            wanted = [tick for tick in ticks[len(positions) :] if tick <= end + 1e-12]
            outcome = solver(stretch(problem, phase, goal, state, now, end, wanted))
            for sample in outcome.samples:
                positions.append((sample[0], sample[1], sample[2]))
                forces.append(phase.force(sample))
            now, state = outcome.at, outcome.state
            if outcome.fallen is not None:
                phase, more = settled(phase.guards[outcome.fallen].successor(state), state)
                events += 1 + more
                if events > EVENTS_MOST:
                    raise ArithmeticError(f"{problem.name}: more than {EVENTS_MOST} events")
    return Trajectory(positions, forces, events)


def stretch(
    problem: Problem, phase: Phase, goal: Vector, state: MotionState, begin: float, end: float, ticks: list[float]
) -> Stretch:
    field: Callable[[MotionState], list[float]] = lambda now: rate(problem.body, goal, phase, now)  # noqa: E731
    guards = [guard.value for guard in phase.guards]
    return Stretch(field, guards, state, begin, end, [min(tick, end) for tick in ticks])
