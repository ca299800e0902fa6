from collections.abc import Callable
from itertools import count
from math import sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.slave.integrators.problems import ball, wall
from weberlink.slave.integrators import INTEGRATORS, ControlledMass
from weberlink.slave.integrators.choice import BUDGET, SPLITTING_S, chosen
from weberlink.slave.robots.simulated import SimulatedOptions, SimulatedRobot
from weberlink.slave.scenes.contact import FrictionCone, SceneObject
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.solids import SphereShape

TICK = 0.001
CONE = FrictionCone(0.5, 0.4)


def body(mass: float, stiffness: float = 2e4) -> ControlledMass:
    return ControlledMass(mass, stiffness, 2.0 * sqrt(stiffness * mass))


def test_one_step_of_a_closed_form_is_enough() -> None:
    assert chosen(body(0.2), wall(500.0, 1.0), TICK)[:2] == ("exact", 1)
    assert chosen(body(1e-3), wall(1e7), 10.0 * TICK)[:2] == ("exact", 1)
    assert chosen(body(0.2), wall(1e5, None, CONE), 10.0 * TICK)[:2] == ("exact", 1)
    assert chosen(body(0.2), None, TICK) == ("exact", 1, "no contact")


def test_elsewhere_substeps_fill_the_budget() -> None:
    assert chosen(body(0.2), ball(1e5), TICK)[:2] == ("exact", int(BUDGET * TICK / SPLITTING_S))
    assert chosen(body(0.2), ball(1e5), 10.0 * TICK)[:2] == ("exact", int(BUDGET * 10.0 * TICK / SPLITTING_S))
    assert chosen(body(1000.0, 1.0), ball(1.0), 10.0 * TICK)[:2] == ("exact", 1)  # more would resolve no more
    assert chosen(body(0.2), wall(1e5, 3.0, CONE), 10.0 * TICK).substeps > 1
    assert "over the budget" in chosen(body(0.2), ball(1e5), 0.1 * TICK).reason
    assert "over the budget" not in chosen(body(0.2), ball(1e5), TICK).reason


@pytest.mark.parametrize(
    ("scene", "step_s", "substeps"),
    [
        (ball(1e5), 20e-6, 7),
        (ball(1e5), 400e-6, 1),
        (wall(1e5), 20e-6, 1),  # a closed form
        (Scene([SceneObject(SphereShape((0.0, 0.0, -1.0), 0.03), 1e5)]), 20e-6, int(BUDGET * TICK / SPLITTING_S)),
    ],
    ids=["quick", "slow", "flat", "out of reach"],
)
def test_a_live_robot_measures_its_steps(scene: Scene, step_s: float, substeps: int) -> None:
    robot = SimulatedRobot(SimulatedOptions(), scene, TICK)
    robot.measure_steps(count(step=step_s).__next__)
    assert (robot.integrator, robot.substeps) == ("exact", substeps)
    robot.open(0.0)
    assert robot.latest(TICK).force == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("mass", "stiffness", "substeps", "told"),
    [
        (1e-4, 1e7, None, r"^integrator: semi_implicit is unstable in 64 .* expected integrator: auto"),
        (0.1, 1e6, 1, r"^integrator: semi_implicit is unstable in 1 .* expected substeps: 16, or integrator: auto"),
    ],
)
def test_unstable_named_scheme_is_refused(mass: float, stiffness: float, substeps: int | None, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        chosen(body(mass), wall(stiffness), TICK, "semi_implicit", substeps)


@given(
    st.floats(1e-6, 1000.0),
    st.floats(1e-3, 1e9),
    st.floats(1e-3, 1e9),
    st.one_of(st.none(), st.floats(0.0, 1e6)),
    st.floats(1e-4, 1e-1),
    st.sampled_from([wall, ball]),
    st.sampled_from([None, CONE]),
)
def test_auto_gains_no_energy_and_keeps_its_budget(
    mass: float,
    control: float,
    stiffness: float,
    damping: float | None,
    tick: float,
    solid: Callable[[float, float | None, FrictionCone | None], Scene],
    cone: FrictionCone | None,
) -> None:
    name, substeps, reason = chosen(body(mass, control), solid(stiffness, damping, cone), tick)
    assert INTEGRATORS[name].gains_nothing
    assert substeps == 1 or substeps * SPLITTING_S <= BUDGET * tick
    assert reason
