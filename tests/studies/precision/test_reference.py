"""The known solutions: two solvers that agree on every problem, and closed forms that neither of them has seen."""

from functools import cache
from math import cos, exp, sin, sqrt

import pytest

pytest.importorskip("scipy")

from weberlink.slave.integrators.contract import ControlledMass
from weberlink.studies.precision.equations import beginning
from weberlink.studies.precision.problem import TICK, Ball, Friction, HalfSpace, Problem, Surface
from weberlink.studies.precision.problems import PROBLEMS
from weberlink.studies.precision.reference import AGREEMENT, SOLVERS, Trajectory, reference, trajectory

UP = (0.0, 0.0, 1.0)
FLOOR = HalfSpace((0.0, 0.0, 0.0), UP)


def oscillation(body: ControlledMass, goal: float, start: float, velocity: float, at: float) -> float:
    """m a = k (goal - x) - c v, underdamped."""
    decay = body.damping / (2.0 * body.mass)
    omega = sqrt(body.stiffness / body.mass - decay * decay)
    away = start - goal
    return goal + exp(-decay * at) * (away * cos(omega * at) + (velocity + decay * away) / omega * sin(omega * at))


@pytest.fixture(params=list(SOLVERS))
def solver(request: pytest.FixtureRequest) -> str:
    return str(request.param)


known = cache(reference)


def solution(problem: Problem, solver: str) -> Trajectory:
    return trajectory(problem, SOLVERS[solver])


@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda problem: problem.name)
def test_both_solvers_agree_on_every_problem(problem: Problem) -> None:
    solved = known(problem)
    assert solved.agreement <= AGREEMENT
    assert len(solved.trajectory.positions) == len(solved.trajectory.forces) == round(problem.duration / TICK)
    assert solved.position_scale > 1e-4
    assert solved.force_scale > 1.0


def test_the_problem_set_has_what_each_name_promises() -> None:
    events = {problem.name: known(problem).trajectory.events for problem in PROBLEMS}
    for problem in PROBLEMS:
        if problem.smooth:
            assert events[problem.name] == len(problem.surfaces)  # touched at the start, and never left
    assert events["grazing"] == 0
    assert events["wall_1e7"] >= 4
    assert events["stick_slip"] >= 6
    assert len({problem.name for problem in PROBLEMS}) == len(PROBLEMS)


def test_goals_change_at_whole_multiples_of_the_coarsest_step() -> None:
    for problem in PROBLEMS:
        coarsest = problem.coarsest_ticks * TICK
        for at in [problem.duration, *(since for since, _ in problem.goals)]:
            assert at / coarsest == pytest.approx(round(at / coarsest), abs=1e-9), problem.name


def test_free_motion_is_the_oscillation_that_it_is_in_closed_form(solver: str) -> None:
    body = ControlledMass(0.3, 900.0, 2.0)
    problem = Problem("free", "", body, (), ((0.0, (0.0, 0.0, 0.02)),), (0.0, 0.0, 0.05), (0.0, 0.0, 0.4), 0.2)
    for tick, position in enumerate(solution(problem, solver).positions, start=1):
        expected = oscillation(body, 0.02, 0.05, 0.4, tick * TICK)
        assert position == pytest.approx((0.0, 0.0, expected), abs=1e-13)


def test_linear_contact_is_an_oscillation_about_its_own_equilibrium(solver: str) -> None:
    body, wall, damping, goal = ControlledMass(0.2, 3000.0, 6.0), 20_000.0, 5.0, -0.01
    surfaces, goals = (Surface(FLOOR, wall, damping),), ((0.0, (0.0, 0.0, goal)),)
    problem = Problem("wall", "", body, surfaces, goals, (0.0,) * 3, (0.0, 0.0, -0.3), 0.05)
    joined = ControlledMass(0.2, body.stiffness + wall, body.damping + damping)
    rest = body.stiffness * goal / joined.stiffness
    found = solution(problem, solver)
    for tick, position in enumerate(found.positions, start=1):
        assert position[2] == pytest.approx(oscillation(joined, rest, 0.0, -0.3, tick * TICK), abs=1e-13)
    assert found.events == 1


def test_a_bounce_is_two_free_flights_about_half_an_oscillation(solver: str) -> None:
    """Without position control: speed and time of contact pi sqrt(m / k) are known, and no energy is lost."""
    mass, wall, speed = 0.2, 1e7, 0.3
    start = 0.01
    surfaces, goals = (Surface(FLOOR, wall),), ((0.0, (0.0, 0.0, 0.0)),)
    free = ControlledMass(mass, 0.0, 0.0)
    problem = Problem("bounce", "", free, surfaces, goals, (0.0, 0.0, start), (0.0, 0.0, -speed), 0.06)
    found = solution(problem, solver)
    left = start / speed + 3.141592653589793 * sqrt(mass / wall)
    assert found.positions[-1][2] == pytest.approx(speed * (0.06 - left), abs=1e-12)
    assert found.events == 2


def test_a_sliding_body_rests_where_the_drive_balances_the_dynamic_friction(solver: str) -> None:
    """Critically damped, so that it never turns back: m x'' = k (goal - x) - c x' - mu_dynamic k_wall depth."""
    wall, depth, dynamic = 5000.0, 1e-3, 0.4
    body = ControlledMass(0.1, 2000.0, 28.3)
    goal = -depth * (1.0 + wall / body.stiffness)
    surface = Surface(FLOOR, wall, friction=Friction(0.5, dynamic))
    goals = ((0.0, (0.0, 0.0, goal)), (0.1, (0.05, 0.0, goal)))
    problem = Problem("slide", "", body, (surface,), goals, (0.0,) * 3, duration=0.4, linear=False)
    found = solution(problem, solver)
    assert found.positions[99] == pytest.approx((0.0, 0.0, -depth), abs=1e-8)
    assert found.positions[-1] == pytest.approx((0.05 - dynamic * wall * depth / body.stiffness, 0.0, -depth), abs=1e-8)
    assert found.forces[-1] == pytest.approx((-dynamic * wall * depth, 0.0, wall * depth), rel=1e-6)


def test_an_oblique_corner_holds_the_body_where_both_surfaces_meet() -> None:
    """At rest deep in the corner the push is along what leads back to the edge: projection, not a sum of depths."""
    half = sqrt(0.5)
    surfaces = (Surface(FLOOR, 1e4), Surface(HalfSpace((0.0, 0.0, 0.0), (half, 0.0, half)), 1e4))
    problem = Problem("edge", "", ControlledMass(1.0, 0.0, 0.0), surfaces, ((0.0, (0.0,) * 3),), (0.0,) * 3)
    state = [-3e-3, 0.0, -1e-3, 0.0, 0.0, 0.0]
    phase = beginning(problem)
    while fallen := [guard for guard in phase.guards if guard.value(state) < 0.0]:
        phase = fallen[0].successor(state)
    # (-3, -1) mm violates only the slope after the projection onto it: 2 mm sqrt(2) along its normal.
    assert phase.force(state) == pytest.approx((20.0, 0.0, 20.0))


def test_friction_on_a_ball_is_refused() -> None:
    surface = Surface(Ball((0.0,) * 3, 0.01), 1e3, friction=Friction(0.5, 0.4))
    problem = Problem("ball", "", ControlledMass(1.0, 0.0, 0.0), (surface,), ((0.0, (0.0,) * 3),), (0.0, 0.0, 0.02))
    with pytest.raises(ValueError, match="half-space"):
        reference(problem)
