"""Orders of convergence, measured: the slope of log error over log steps."""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from tests.slave.integrators.problems import BODY, ball, difference, run, wall
from weberlink.geometry.vector import Vector
from weberlink.slave.integrators import INTEGRATORS, MassState
from weberlink.slave.scenes.scene import Scene

STEPS = (40, 80, 160, 320)
FINEST = 3000


class Problem(NamedTuple):
    make: Callable[[], Scene | None]
    position: Vector
    velocity: Vector
    goal: Vector
    duration: float

    def arrived(self, name: str, steps: int) -> MassState:
        return arrival(self, name, steps)


@cache
def arrival(problem: Problem, name: str, steps: int) -> MassState:
    return run(name, BODY, *problem, steps)


SMOOTH = {
    "free": Problem(lambda: None, (0.0, 0.0, 0.03), (0.1, 0.2, 0.3), (0.01, 0.0, 0.02), 0.05),
    "in a wall": Problem(lambda: wall(2000.0, 5.0), (0.0, 0.0, -0.004), (0.1, 0.0, -0.05), (0.01, 0.0, -0.02), 0.02),
    "in a ball": Problem(lambda: ball(2000.0), (0.001, 0.0, -0.004), (0.2, 0.1, 0.0), (0.02, 0.01, -0.02), 0.02),
    "in a damped ball": Problem(
        lambda: ball(2000.0, 5.0), (0.001, 0.0, -0.004), (0.2, 0.1, 0.0), (0.02, 0.01, -0.02), 0.02
    ),
}
BOUNCE = Problem(lambda: ball(2000.0), (0.001, 0.0, 0.004), (0.1, 0.0, -0.5), (0.01, 0.0, 0.005), 0.05)


def slope(name: str, problem: Problem, truth: MassState) -> float:
    errors = [difference(problem.arrived(name, steps), truth, 0.01) for steps in STEPS]
    return -float(np.polyfit(np.log(STEPS), np.log(errors), 1)[0])


@pytest.mark.parametrize("problem", SMOOTH)
@pytest.mark.parametrize("name", sorted(INTEGRATORS))
def test_order_on_smooth_motion_is_as_tabulated(name: str, problem: str) -> None:
    scheme, case = INTEGRATORS[name], SMOOTH[problem]
    truth = case.arrived("exact", FINEST)
    if scheme.exact_if_linear and "ball" not in problem:
        assert difference(case.arrived(name, STEPS[0]), truth, 0.01) < 1e-13
    else:
        assert slope(name, case, truth) == pytest.approx(scheme.order, abs=0.2)


@pytest.mark.parametrize(("name", "least"), [("semi_implicit", 0.8), ("implicit", 1.5), ("exact", 1.8)])
def test_order_across_a_bounce(name: str, least: float) -> None:
    assert slope(name, BOUNCE, BOUNCE.arrived("exact", FINEST)) > least


def test_reference_solutions_of_two_schemes_agree() -> None:
    """The reference of the orders above is right."""
    for case in SMOOTH.values():
        assert difference(case.arrived("implicit", FINEST // 2), case.arrived("exact", FINEST), 0.01) < 1.2e-7
