"""Every problem with every integrator and step: the rows, the orders they show, and how the recommended choice fares.

Needs scipy (extra: precision) for the references.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any

from weberlink.slave.integrators import INTEGRATORS
from weberlink.slave.integrators.contract import IntegrationScheme
from weberlink.studies.precision.convergence import fitted_order
from weberlink.studies.precision.pareto import Point, cheapest_as_good, front
from weberlink.studies.precision.problem import Problem, Quantity
from weberlink.studies.precision.problems import PROBLEMS
from weberlink.studies.precision.reference import Reference, reference
from weberlink.studies.precision.run import Row, Step, measured

Chooser = Callable[[Problem], tuple[str, int]]
"""The integrator and the substeps per tick that are recommended for a problem."""

Progress = Callable[[str, int, int], None]
"""Told what comes next, how much is done, and of how much."""

RESOLVED = 1e-12
"""Relative errors below it are rounding and count as equal."""
EXACT = 1e-9
"""What an integrator that is exact on linear contact must reach, relative."""
NOISE_LEAST = 0.05
"""Two run times closer than this share are never told apart."""
ORDER_TOLERANCE = 0.2


@dataclass(frozen=True)
class Effort:
    """Steps from the coarsest of a problem to `finest` per tick, each half the last, timed up to `repeats` times."""

    finest: int
    repeats: int

    def steps(self, problem: Problem, also: int | None = None) -> list[Step]:
        """The coarsest first; `also` is a number of substeps that must be among them."""
        steps, ticks = [], problem.coarsest_ticks
        while ticks > 1:
            steps.append(Step(ticks=ticks))
            ticks //= 2
        substeps = 1
        while substeps <= self.finest:
            steps.append(Step(substeps=substeps))
            substeps *= 2
        if also is not None and Step(substeps=also) not in steps:
            steps.append(Step(substeps=also))
        return sorted(steps, key=lambda step: -step.length)


DEFAULT = Effort(finest=64, repeats=5)
FULL = Effort(finest=512, repeats=15)


@dataclass(frozen=True)
class Order:
    """How fast an error falls with the step, beside what theory says."""

    problem: str
    integrator: str
    quantity: Quantity
    fitted: float | None
    """None where fewer than three steps are in the asymptotic range, as where there is no error to fit."""
    theory: int
    exact: bool
    """Whether theory says that there is no error at any step."""
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
    """What is chosen for a problem at the tick rate, against everything else that fits a tick."""

    row: Row
    rival: Row
    """The cheapest that is as good; the row itself if nothing is cheaper."""

    @property
    def excess(self) -> float:
        """Run time against the rival's; 1 on the Pareto front."""
        return self.row.run_time / self.rival.run_time

    @property
    def noise(self) -> float:
        """Share of run time that the repeats leave open."""
        return max(NOISE_LEAST, 0.5 * (self.row.run_time_spread + self.rival.run_time_spread))

    @property
    def on_front(self) -> bool:
        return not self.row.diverged and self.excess <= 1.0 + self.noise

    def as_json(self) -> dict[str, Any]:
        return {
            **self.row.as_json(),
            "rival": {"integrator": self.rival.integrator, "step_us": 1e6 * self.rival.step.length},
            "run_time_excess": self.excess,
            "noise": self.noise,
            "on_front": self.on_front,
        }


@dataclass(frozen=True)
class Result:
    """What was measured on one problem."""

    problem: Problem
    reference: Reference
    rows: list[Row]
    orders: list[Order]
    recommendation: Recommendation | None
    front: set[int] = field(default_factory=set)
    """Indices of the rows that nothing else beats, whatever their step."""

    @property
    def floor(self) -> float:
        """Relative errors below it are not told apart."""
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
) -> list[Result]:
    """Runs everything.

    Args:
        effort: how fine and how often.
        problems: which of them.
        schemes: integrators by name.
        chooser: what is recommended; None leaves recommendations out.
        progress: called before each problem, and once at the end.
    """
    results = []
    for done, problem in enumerate(problems):
        progress(problem.name, done, len(problems))
        results.append(studied(problem, effort, schemes, chooser))
    progress("done", len(problems), len(problems))
    return results


def studied(
    problem: Problem, effort: Effort, schemes: Mapping[str, IntegrationScheme], chooser: Chooser | None
) -> Result:
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
    best = set(front([point(row, floor) for row in rows]))
    chosen = [row for row in rows if row.integrator == name and row.step == Step(substeps=substeps or 0)]
    return Result(problem, known, rows, orders, recommendation(chosen[0], rows, floor) if chosen else None, best)


def resolved(known: Reference) -> float:
    """The relative error below which two results count as equal."""
    return max(RESOLVED, 10.0 * known.agreement)


def convergence(
    problem: Problem, name: str, scheme: IntegrationScheme, quantity: Quantity, rows: Sequence[Row], floor: float
) -> Order:
    mine = [row for row in rows if row.integrator == name]
    errors = [row.position_error if quantity == "position" else row.force_error for row in mine]
    usable = [error if error < inf else None for error in errors]
    fitted = fitted_order([row.step.length for row in mine], usable, floor)
    exact = problem.linear and scheme.exact_if_linear
    return Order(problem.name, name, quantity, fitted, scheme.order, exact, max(errors))


def point(row: Row, floor: float) -> Point:
    """Run time and position error as compared: at least `floor`, and infinite for what diverged."""
    return (row.run_time, inf if row.diverged else max(row.position_error, floor))


def recommendation(chosen: Row, rows: Sequence[Row], floor: float) -> Recommendation:
    candidates = [row for row in rows if row.step.fits_tick]
    points = [point(row, floor) for row in candidates]
    rival = cheapest_as_good(points, point(chosen, floor)[1])
    return Recommendation(chosen, candidates[rival] if rival is not None else chosen)
