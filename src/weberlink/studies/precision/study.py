"""Work-precision study: every problem with every integrator and step. Needs scipy (extra: studies)."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any

from weberlink.slave.integrators import INTEGRATORS
from weberlink.slave.integrators.contract import IntegrationScheme
from weberlink.slave.robots.simulated import SimulatedOptions, SimulatedRobot
from weberlink.studies.precision.measurement import (
    IntegratorRow,
    Point,
    StepSize,
    best_in_time,
    finite_or_none,
    fitted_order,
    front,
    measured,
)
from weberlink.studies.precision.problems import PROBLEMS, TICK, Problem, Quantity
from weberlink.studies.precision.reference import ReferenceSolution, reference
from weberlink.system.interruption import Interruption

Chooser = Callable[[Problem], tuple[str, int]]
"""The recommended integrator and its substeps per tick for a problem."""

Progress = Callable[[int, int, str], None]
"""Receives the number of finished pieces, the number of all, and the name of the next piece."""

RESOLVED = 1e-12
"""Relative errors below it are rounding errors and count as equal."""
EXACT = 1e-9
"""Largest relative error of an integrator that is exact on linear contact."""
NOISE_LEAST = 0.05
"""Run times that differ by less than this share count as equal."""
ORDER_TOLERANCE = 0.2
NEAR_FRONT = 1.5
"""Largest error of the recommended integrator, over the smallest error in the same time."""
GAINED = 1e-9
"""Share of the energy up to which a gain is rounding."""


@dataclass(frozen=True)
class Effort:
    """How fine and how often.

    Args:
        finest: most substeps per tick. Steps are halved from the coarsest of a problem down to this one.
        repeats: most timed runs of each step.
    """

    finest: int
    repeats: int

    def steps(self, problem: Problem, also: int | None = None) -> list[StepSize]:
        """The coarsest first; `also` is a number of substeps that must be among them."""
        steps, ticks = [], problem.coarsest_ticks
        while ticks > 1:
            steps.append(StepSize(ticks=ticks))
            ticks //= 2
        substeps = 1
        while substeps <= self.finest:
            steps.append(StepSize(substeps=substeps))
            substeps *= 2
        if also is not None and StepSize(substeps=also) not in steps:
            steps.append(StepSize(substeps=also))
        return sorted(steps, key=lambda step: -step.length)


DEFAULT = Effort(finest=64, repeats=5)
FULL = Effort(finest=512, repeats=15)


@dataclass(frozen=True)
class ConvergenceOrder:
    """The order of convergence of an error, beside the order in theory."""

    problem: str
    integrator: str
    quantity: Quantity
    fitted: float | None
    """None where fewer than three steps are in the asymptotic range."""
    theory: int
    exact: bool
    """Whether the integrator is exact in theory."""
    largest_error: float
    """Over all steps."""

    @property
    def holds(self) -> bool:
        """Whether theory is met within 0.2."""
        if self.exact:
            return self.largest_error <= EXACT
        return self.fitted is not None and abs(self.fitted - self.theory) <= ORDER_TOLERANCE

    def as_json(self) -> dict[str, Any]:
        return {
            "problem": self.problem,
            "integrator": self.integrator,
            "quantity": self.quantity,
            "order": self.fitted,
            "order_in_theory": self.theory,
            "exact_in_theory": self.exact,
            "largest_error": self.largest_error if self.largest_error < inf else None,
            "holds": self.holds,
        }


@dataclass(frozen=True)
class Recommendation:
    """The recommended integrator at the tick rate, against every integrator and step that fits a tick."""

    row: IntegratorRow
    rival: IntegratorRow
    """The row with the smallest error that takes no more time; the recommended row itself if none has a smaller one."""
    thriftiest: IntegratorRow
    """The row that gains the least energy and takes no more time; the recommended row itself if none gains less."""
    floor: float = RESOLVED
    """Relative errors below it count as equal."""

    @property
    def excess(self) -> float:
        """Error over that of the rival; 1 on the Pareto front."""
        return point(self.row, self.floor)[1] / point(self.rival, self.floor)[1]

    @property
    def gain_excess(self) -> float:
        """Energy gained beyond that of the thriftiest row, relative to the largest energy."""
        return self.row.energy_gained - self.thriftiest.energy_gained

    @property
    def on_front(self) -> bool:
        return not self.row.diverged and self.excess <= NEAR_FRONT and not self.gain_excess > GAINED

    def as_json(self) -> dict[str, Any]:
        return {
            **self.row.as_json(),
            "rival": {"integrator": self.rival.integrator, "step_us": 1e6 * self.rival.step.length},
            "error_excess": finite_or_none(self.excess),
            "energy_gained_in_excess": finite_or_none(self.gain_excess),
            "on_front": self.on_front,
        }


@dataclass(frozen=True)
class ProblemResult:
    """All rows of one problem."""

    problem: Problem
    reference: ReferenceSolution
    rows: list[IntegratorRow]
    orders: list[ConvergenceOrder]
    recommendation: Recommendation | None
    front: set[int] = field(default_factory=set)
    """Indices of the rows on the Pareto front."""

    @property
    def floor(self) -> float:
        """Relative errors below it count as equal."""
        return resolved(self.reference)

    def as_json(self) -> dict[str, Any]:
        chosen = self.recommendation.row if self.recommendation is not None else None
        return {
            "problem": self.problem.name,
            "about": self.problem.about,
            "duration_s": self.problem.duration,
            "mass_kg": self.problem.body.mass,
            "stiffness_n_m": [surface.stiffness for surface in self.problem.surfaces],
            "damping_n_s_m": [surface.damping for surface in self.problem.surfaces],
            "smooth": sorted(self.problem.smooth),
            "linear": self.problem.linear,
            **self.reference.as_json(),
            "recommended": self.recommendation.as_json() if self.recommendation is not None else None,
            "orders": [order.as_json() for order in self.orders],
            "rows": [
                {**row.as_json(), "on_front": index in self.front, "recommended": row is chosen}
                for index, row in enumerate(self.rows)
            ],
        }


def study(
    effort: Effort = DEFAULT,
    problems: Sequence[Problem] = PROBLEMS,
    schemes: Mapping[str, IntegrationScheme] = INTEGRATORS,
    chooser: Chooser | None = None,
    progress: Progress = lambda *_: None,
) -> list[ProblemResult]:
    """Run everything, or what is done when Ctrl-C comes.

    Args:
        effort: how fine and how often.
        problems: which of them.
        schemes: integrators by name.
        chooser: recommends an integrator; None leaves recommendations out.
        progress: called before each problem, and at the end.
    """

    def one_by_one() -> Iterator[ProblemResult]:
        for done, problem in enumerate(problems):
            progress(done, len(problems), problem.name)
            yield studied(problem, effort, schemes, chooser)
        progress(len(problems), len(problems), "done")

    return list(Interruption().pieces(one_by_one()))


def studied(
    problem: Problem, effort: Effort, schemes: Mapping[str, IntegrationScheme], chooser: Chooser | None
) -> ProblemResult:
    known = reference(problem)
    name, substeps = chooser(problem) if chooser is not None else (None, None)
    rows = [
        measured(problem, scheme_name, scheme, step, known, effort.repeats)
        for scheme_name, scheme in schemes.items()
        for step in effort.steps(problem, substeps if scheme_name == name else None)
    ]
    floor = resolved(known)
    orders = [
        convergence(problem, scheme_name, scheme, quantity, rows, floor)
        for scheme_name, scheme in schemes.items()
        for quantity in sorted(problem.smooth)
    ]
    best = {index for index, on in enumerate(front([point(row, floor) for row in rows])) if on}
    chosen = [row for row in rows if row.integrator == name and row.step == StepSize(substeps=substeps or 0)]
    return ProblemResult(problem, known, rows, orders, recommendation(chosen[0], rows, floor) if chosen else None, best)


def resolved(known: ReferenceSolution) -> float:
    """The relative error below which two results count as equal."""
    return max(RESOLVED, 10.0 * known.agreement)


def convergence(
    problem: Problem,
    name: str,
    scheme: IntegrationScheme,
    quantity: Quantity,
    rows: Sequence[IntegratorRow],
    floor: float,
) -> ConvergenceOrder:
    mine = [row for row in rows if row.integrator == name]
    errors = [row.position_error if quantity == "position" else row.force_error for row in mine]
    usable = [error if error < inf else None for error in errors]
    fitted = fitted_order([row.step.length for row in mine], usable, floor)
    exact = problem.linear and scheme.exact_if_linear
    return ConvergenceOrder(problem.name, name, quantity, fitted, scheme.order, exact, max(errors))


def point(row: IntegratorRow, floor: float) -> Point:
    """Run time and position error as compared: at least `floor`, and infinite for what diverged."""
    return (row.run_time, inf if row.diverged else max(row.position_error, floor))


def recommendation(chosen: IntegratorRow, rows: Sequence[IntegratorRow], floor: float) -> Recommendation:
    candidates = [row for row in rows if row.step.fits_tick]
    time = chosen.run_time * (1.0 + max(NOISE_LEAST, 0.5 * chosen.run_time_spread))
    rival = best_in_time([point(row, floor) for row in candidates], time)
    thriftiest = best_in_time([(row.run_time, row.energy_gained) for row in candidates], time)
    assert rival is not None and thriftiest is not None
    best, least = candidates[rival], candidates[thriftiest]
    return Recommendation(
        chosen,
        best if point(best, floor)[1] < point(chosen, floor)[1] else chosen,
        least if least.energy_gained < chosen.energy_gained else chosen,
        floor,
    )


def automatic(problem: Problem) -> tuple[str, int]:
    """The choice of `integrator: auto` for a problem at the tick rate."""
    mass, stiffness, damping = problem.body
    options = SimulatedOptions(mass_kg=mass, stiffness_n_m=stiffness, damping_n_s_m=damping)
    robot = SimulatedRobot(options, problem.scene(), TICK)
    return robot.integrator, robot.substeps
