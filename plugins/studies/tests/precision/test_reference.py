"""The known solutions: two solvers that agree on every problem, and closed forms that neither of them has seen."""

import pytest

pytest.importorskip("scipy")

from weberlink.slave.integrators import ControlledMass
from weberlink_studies.precision.problems import PROBLEMS, TICK, CoulombFriction, HalfSpace, Problem, ProblemSurface
from weberlink_studies.precision.reference import (
    AGREEMENT,
    Solver,
    Trajectory,
    closed_form,
    dop853,
    lsoda,
    reference,
    trajectory,
)

UP = (0.0, 0.0, 1.0)
FLOOR = HalfSpace((0.0, 0.0, 0.0), UP)
SOLVERS: dict[str, Solver] = {"dop853": dop853, "closed_form": closed_form, "lsoda": lsoda}
SLOW = ("wall_1e7", "hollow_1e6", "rough_1e6", "overdamped")
"""Problems whose reference takes seconds."""
EVENTS = {"wall_1e7": 4, "stick_slip": 6}
"""Events of a problem at least."""


@pytest.fixture(params=list(SOLVERS))
def solver(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def solution(problem: Problem, solver: str) -> Trajectory:
    return trajectory(problem, SOLVERS[solver])


@pytest.mark.parametrize(
    "problem",
    [
        pytest.param(problem, id=problem.name, marks=[pytest.mark.hunt] if problem.name in SLOW else [])
        for problem in PROBLEMS
    ],
)
def test_both_solvers_agree_on_every_problem(problem: Problem) -> None:
    solved = reference(problem)
    assert solved.agreement <= AGREEMENT
    assert len(solved.trajectory.positions) == len(solved.trajectory.forces) == round(problem.duration / TICK)
    assert solved.position_scale > 1e-4
    assert solved.force_scale > 1.0
    if problem.smooth:
        assert solved.trajectory.events == len(problem.surfaces)  # touched at the start, and never left
    assert solved.trajectory.events >= EVENTS.get(problem.name, 0)
    assert solved.trajectory.events == 0 or problem.name != "grazing"


def test_a_sliding_body_rests_at_dynamic_friction(solver: str) -> None:
    """Critically damped, so that it never turns back: m x'' = k (goal - x) - c x' - mu_dynamic k_wall depth."""
    wall, depth, dynamic = 5000.0, 1e-3, 0.4
    body = ControlledMass(0.1, 2000.0, 28.3)
    goal = -depth * (1.0 + wall / body.stiffness)
    surface = ProblemSurface(FLOOR, wall, friction=CoulombFriction(0.5, dynamic))
    goals = ((0.0, (0.0, 0.0, goal)), (0.1, (0.05, 0.0, goal)))
    problem = Problem("slide", "", body, (surface,), goals, (0.0,) * 3, duration=0.4, linear=False)
    found = solution(problem, solver)
    assert found.positions[99] == pytest.approx((0.0, 0.0, -depth), abs=1e-8)
    assert found.positions[-1] == pytest.approx((0.05 - dynamic * wall * depth / body.stiffness, 0.0, -depth), abs=1e-8)
    assert found.forces[-1] == pytest.approx((-dynamic * wall * depth, 0.0, wall * depth), rel=1e-6)
