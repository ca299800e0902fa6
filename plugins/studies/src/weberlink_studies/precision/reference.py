"""Reference solutions: each problem solved by two independent solvers from event to event, and their agreement.

`dop853` is the explicit method of order 8 by Dormand and Prince (Hairer, Norsett, Wanner, "Solving Ordinary
Differential Equations I"). `closed_form` is the matrix exponential of motion whose field is affine, as between events
on flat faces. `lsoda` is the multistep method of Hindmarsh and Petzold, for the rest. They share no code, and need
scipy (extra: studies).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf, pi
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from weberlink.geometry.vector import Vector, distance, norm
from weberlink_studies.precision.equations import MotionState, Phase, beginning, rate
from weberlink_studies.precision.problems import TICK, HalfSpace, Problem

RELATIVE = 3e-14  # the smallest tolerance that scipy accepts is 100 roundings
ABSOLUTE = (1e-17, 1e-17, 1e-17, 1e-15, 1e-15, 1e-15)  # [m], [m/s]
LOOKS = 64  # times in a period or time constant at which `closed_form` evaluates the guards, and the least in a stretch
CHUNK = 256

Array = NDArray[np.floating[Any]]


class Stretch(NamedTuple):
    """An initial value problem between two events."""

    field: Callable[[MotionState], list[float]]  # d(state)/dt
    # functions of the state; the stretch ends where the first of them falls below zero
    guards: Sequence[Callable[[MotionState], float]]
    state: MotionState  # at `begin`
    begin: float  # [s]
    end: float  # [s], more than `begin`
    ticks: Sequence[float]  # times in (begin, end] at which the state is wanted, ascending [s]


class Outcome(NamedTuple):
    """States at the ticks reached; time [s], state and guard of the end (None: no guard fell)."""

    samples: list[list[float]]
    at: float
    state: list[float]
    fallen: int | None


class Solver(Protocol):
    def __call__(self, stretch: Stretch) -> Outcome:
        """Solve one stretch.

        Raises:
            ArithmeticError: if the accuracy cannot be reached.
        """
        ...


def integrated(method: str, stretch: Stretch) -> Outcome:
    """Solve with a method of scipy; see `Solver`."""
    from scipy.integrate import solve_ivp  # noqa: PLC0415 - an extra, imported where it is needed

    answer = solve_ivp(
        lambda _, state: stretch.field(state.tolist()),
        (stretch.begin, stretch.end),
        np.array(stretch.state),
        method=method,
        t_eval=[*stretch.ticks, *([] if stretch.end in stretch.ticks else [stretch.end])],
        events=[falling(guard) for guard in stretch.guards],
        rtol=RELATIVE,
        atol=ABSOLUTE,
    )
    if answer.status < 0:
        raise ArithmeticError(f"{method}: {answer.message}")
    samples = np.transpose(answer.y).tolist()  # scipy returns an empty list before the first tick
    for index, (times, states) in enumerate(zip(answer.t_events or (), answer.y_events or (), strict=True)):
        if len(times):
            return Outcome(samples, float(times[0]), states[0].tolist(), index)
    return Outcome(samples[: len(stretch.ticks)], stretch.end, samples[-1], None)


dop853: Solver = partial(integrated, "DOP853")
lsoda: Solver = partial(integrated, "LSODA")


def falling(guard: Callable[[MotionState], float]) -> Callable[[float, Array], float]:
    """The guard as a terminal event of scipy."""

    def event(_: float, state: Array) -> float:
        return guard(state.tolist())

    event.terminal = True  # type: ignore[attr-defined]
    event.direction = -1.0  # type: ignore[attr-defined]
    return event


def closed_form(stretch: Stretch) -> Outcome:
    """Solve x' = A x + b as exp(G t) (x, 1) with G = ((A, b), (0, 0)); see `Solver`."""
    from scipy.linalg import expm, matrix_balance  # noqa: PLC0415
    from scipy.optimize import brentq  # noqa: PLC0415

    field, guards = stretch.field, stretch.guards
    constant = np.array(field([0.0] * 6))
    generator = np.zeros((7, 7))
    generator[:6, 6] = constant
    generator[:6, :6] = np.transpose([np.array(field(unit)) - constant for unit in np.eye(6).tolist()])
    # In units in which position and velocity are alike large, the exponential loses less to rounding.
    balanced, units = matrix_balance(generator, permute=False)
    start = np.linalg.solve(units, [*stretch.state, 1.0])

    def states(times: Array) -> list[list[float]]:
        flows = expm(balanced * (times - stretch.begin)[:, None, None])
        found: list[list[float]] = ((flows @ start) @ units.T)[:, :6].tolist()
        return found

    def value(time: float, guard: Callable[[MotionState], float]) -> float:
        return guard(states(np.array([time]))[0])

    eigenvalues = np.linalg.eigvals(generator)
    span = stretch.end - stretch.begin
    step = min(span / LOOKS, 2.0 * pi / (LOOKS * max(float(np.abs(eigenvalues.imag).max()), 1e-9)))
    fastest = 1.0 / (LOOKS * max(float(np.abs(eigenvalues.real).max()), 1.0 / step))
    looks = np.concatenate([np.arange(0.0, span, step), np.geomspace(fastest, step, LOOKS), np.array([span])])
    times = stretch.begin + np.unique(looks)
    before = list(stretch.state)
    for first in range(1, len(times), CHUNK):
        for place, after in enumerate(states(times[first : first + CHUNK]), start=first):
            falls = [
                (float(brentq(value, times[place - 1], times[place], args=(guard,), xtol=1e-18)), index)
                for index, guard in enumerate(guards)
                if guard(before) >= 0.0 > guard(after)
            ]
            if falls:
                at, index = min(falls)
                reached = np.array([tick for tick in stretch.ticks if tick <= at])
                return Outcome(states(reached) if len(reached) else [], at, states(np.array([at]))[0], index)
            before = after
    return Outcome(states(np.array(stretch.ticks)), stretch.end, states(np.array([stretch.end]))[0], None)


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
