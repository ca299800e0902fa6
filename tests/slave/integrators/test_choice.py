"""Which integrator and how many steps `auto` takes."""

from itertools import count
from math import sqrt

import pytest

from tests.slave.integrators.problems import ball, wall
from weberlink.slave.integrators import ControlledMass
from weberlink.slave.integrators.choice import BUDGET, SPLITTING_S, chosen
from weberlink.slave.robots.simulated import SimulatedOptions, SimulatedRobot
from weberlink.slave.scenes.contact import FrictionCone
from weberlink.slave.scenes.scene import Scene

TICK = 0.001
CONE = FrictionCone(static=0.5, dynamic=0.4)
FULL = int(BUDGET * TICK / SPLITTING_S)


def body(mass: float, stiffness: float = 2e4) -> ControlledMass:
    return ControlledMass(mass, stiffness, 2.0 * sqrt(stiffness * mass))


@pytest.mark.parametrize(
    ("mass", "scene", "tick", "substeps"),
    [
        (body(0.2), wall(500.0, 1.0), TICK, 1),  # a closed form
        (body(0.2), wall(1e5, None, CONE), 10.0 * TICK, 1),
        (body(0.2), None, TICK, 1),
        (body(0.2), ball(1e5), TICK, FULL),
        (body(0.2), ball(1e5), 10.0 * TICK, int(BUDGET * 10.0 * TICK / SPLITTING_S)),
        (body(1000.0, 1.0), ball(1.0), 10.0 * TICK, 1),  # more would resolve no more
    ],
)
def test_substeps_fill_the_budget_where_there_is_no_closed_form(
    mass: ControlledMass, scene: Scene | None, tick: float, substeps: int
) -> None:
    assert chosen(mass, scene, tick)[:2] == ("exact", substeps)


@pytest.mark.parametrize(("scene", "step_s", "substeps"), [(ball(1e5), 20e-6, 7), (ball(1e5), 400e-6, 1)])
def test_a_live_robot_measures_its_steps(scene: Scene, step_s: float, substeps: int) -> None:
    robot = SimulatedRobot(SimulatedOptions(), scene, TICK)
    robot.measure_steps(count(step=step_s).__next__)
    assert (robot.integrator, robot.substeps) == ("exact", substeps)
