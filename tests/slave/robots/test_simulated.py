from math import exp, sqrt
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.geometry.vector import ZERO, is_finite
from weberlink.slave.integrators.choice import FEW
from weberlink.slave.robots.contract import RobotFault
from weberlink.slave.robots.simulated import SimulatedOptions, SimulatedRobot
from weberlink.slave.scenes.contact import FrictionCone, SceneObject
from weberlink.slave.scenes.plane import PlaneShape
from weberlink.slave.scenes.scene import Scene

TICK = 0.001
UP = (0.0, 0.0, 1.0)


def wall(stiffness: float, damping: float | None = None) -> Scene:
    return Scene([SceneObject(PlaneShape(ZERO, UP), stiffness, None, damping)])


def test_against_a_wall_it_rests_where_both_springs_agree() -> None:
    robot = SimulatedRobot(SimulatedOptions(stiffness_n_m=2000.0), wall(1000.0), TICK)
    robot.open(0.0)
    for tick in range(1, 1001):
        robot.command((0.0, 0.0, -0.01), tick * TICK)
        reading = robot.latest(tick * TICK)
    assert reading.position[2] == pytest.approx(-0.01 * 2000.0 / 3000.0, abs=1e-9)
    assert reading.force == pytest.approx((0.0, 0.0, 1000.0 * 0.02 / 3.0), abs=1e-5)


@pytest.mark.parametrize(
    ("integrator", "share"), [("auto", 1e-12), ("exact", 1e-12), ("implicit", 0.01), ("semi_implicit", 0.05)]
)
def test_a_free_step_is_that_of_the_critically_damped_oscillator(integrator: Any, share: float) -> None:
    """x(t) = x_d + (x_0 - x_d)(1 + w t) exp(-w t), as well as the integrator can at a tick of half a radian."""
    robot = SimulatedRobot(SimulatedOptions(integrator=integrator), None, TICK)
    omega = sqrt(50_000.0 / 0.2)
    robot.open(0.0)
    robot.command((0.0, 0.0, 0.02), 0.0)
    for tick in range(1, 21):
        x = robot.latest(tick * TICK).position[2]
        t = omega * tick * TICK
        assert x == pytest.approx(0.02 + 0.01 * (1.0 + t) * exp(-t), abs=0.01 * share)


@pytest.mark.parametrize(
    ("stiffness", "mass"), [(1e5, 0.1), (1e6, 0.05), (300.0, 10.0)], ids=["stiff", "very stiff", "soft and heavy"]
)
def test_it_is_stable_against_a_stiff_wall(stiffness: float, mass: float) -> None:
    """Thrown at the wall, then held into it: bounded at every tick, at rest in the end."""
    robot = SimulatedRobot(SimulatedOptions(mass_kg=mass, stiffness_n_m=2e4), wall(stiffness), TICK)
    robot.open(0.0)
    positions = []
    for tick in range(1, 4001):
        robot.command((0.0, 0.0, -0.001), tick * TICK)
        positions.append(robot.latest(tick * TICK).position[2])
    assert min(positions) > -0.03
    assert max(positions) <= 0.03
    assert max(positions[-500:]) - min(positions[-500:]) < 1e-6
    assert positions[-1] == pytest.approx(-0.001 * 2e4 / (2e4 + stiffness), rel=1e-3)


@examples(60)
@given(
    mass=st.floats(0.001, 20.0),
    gain=st.floats(10.0, 1e7),
    damping=st.one_of(st.none(), st.floats(0.1, 1000.0)),
    stiffness=st.floats(10.0, 1e7),
    surface=st.one_of(st.none(), st.floats(0.0, 200.0)),
    rough=st.booleans(),
)
def test_auto_is_never_refused_and_stays_bounded(
    mass: float, gain: float, damping: float | None, stiffness: float, surface: float | None, rough: bool
) -> None:
    options = SimulatedOptions(mass_kg=mass, stiffness_n_m=gain, damping_n_s_m=damping)
    scene = Scene([SceneObject(PlaneShape(ZERO, UP), stiffness, FrictionCone(0.5, 0.4) if rough else None, surface)])
    robot = SimulatedRobot(options, scene, TICK)
    assert 1 <= robot.substeps <= FEW
    robot.open(0.0)
    for tick in range(1, 201):
        robot.command((0.0001 * tick, 0.0, -0.01), tick * TICK)
        reading = robot.latest(tick * TICK)
        assert is_finite(reading.position)
        assert abs(reading.position[2]) < 0.1


@pytest.mark.parametrize(
    ("mass", "damping", "stiffness"), [(1e-3, 5.0, 1e7), (10.0, None, 1e7), (0.2, None, 1e5)], ids=str
)
def test_against_steel_it_comes_to_rest_as_deep_as_it_should(
    mass: float, damping: float | None, stiffness: float
) -> None:
    options = SimulatedOptions(mass_kg=mass, stiffness_n_m=2000.0, damping_n_s_m=damping)
    robot = SimulatedRobot(options, wall(stiffness, 2.0 * sqrt(stiffness * mass)), TICK)
    robot.open(0.0)
    for tick in range(1, 3001):
        robot.command((0.0, 0.0, max(-0.005, 0.03 - 0.0001 * tick)), tick * TICK)
        reading = robot.latest(tick * TICK)
        assert reading.position[2] > -0.005
    assert reading.force == pytest.approx((0.0, 0.0, 10.0 * stiffness / (stiffness + 2000.0)), rel=1e-6, abs=1e-9)
    assert reading.position[2] == pytest.approx(-0.005 * 2000.0 / (stiffness + 2000.0), rel=1e-6)


def test_it_tells_what_was_picked_and_why() -> None:
    steel = SimulatedRobot(SimulatedOptions(), wall(1e7), TICK)
    assert (steel.integrator, steel.substeps) == ("exact", 1)
    assert steel.description() == (
        "0.2 kg, exact integrator (flat contact, 1e+07 N/m is 7.1 rad per tick), lags a ramp by 4.0 ms"
    )
    named = SimulatedRobot(
        SimulatedOptions(mass_kg=0.1, stiffness_n_m=2e4, integrator="semi_implicit"), wall(1e5), TICK
    )
    assert named.substeps == 6  # 1 ms sqrt(1.2e5 / 0.1) / 0.2 = 5.5
    assert named.description() == (
        "0.1 kg, semi_implicit integrator in 6 substeps (as named, 1.2e+05 N/m is 1.1 rad per tick), "
        "lags a ramp by 4.5 ms"
    )


def test_the_substeps_may_be_given() -> None:
    robot = SimulatedRobot(SimulatedOptions(integrator="implicit", substeps=3), wall(1e5), TICK)
    assert robot.substeps == 3
    assert "3 substeps" in robot.description()
    with pytest.raises(ValueError, match="substeps"):
        SimulatedOptions(substeps=0)


def test_an_unstable_choice_is_refused_with_what_to_choose() -> None:
    options = SimulatedOptions(mass_kg=1e-4, stiffness_n_m=1e7, integrator="semi_implicit")
    with pytest.raises(ValueError, match=r"integrator: semi_implicit is unstable .* 0.0001 kg .* integrator: auto"):
        SimulatedRobot(options, wall(1e6), TICK)
    with pytest.raises(ValueError, match="integrator"):
        SimulatedOptions.model_validate({"integrator": "euler"})


@pytest.mark.parametrize("integrator", ["semi_implicit", "implicit", "exact"])
def test_a_second_session_starts_as_afresh(integrator: Any) -> None:
    """Also after one that ended in contact."""
    robot = SimulatedRobot(SimulatedOptions(integrator=integrator), wall(1000.0, 2.0), TICK)
    runs = []
    for _ in range(2):
        robot.open(0.0)
        for tick in range(1, 60):
            robot.command((0.0, 0.0, -0.01), tick * TICK)
            reading = robot.latest(tick * TICK)
        runs.append(reading)
        robot.close()
    assert runs[0] == runs[1]
    assert runs[0].force[2] > 5.0


def test_an_absurd_command_is_a_fault_of_the_robot() -> None:
    robot = SimulatedRobot(SimulatedOptions(), wall(500.0), TICK)
    robot.open(0.0)
    robot.command((1e308, 0.0, 0.0), 0.0)
    with pytest.raises(RobotFault, match="motion is not finite"):
        robot.latest(TICK)


def test_a_robot_lags_as_it_says() -> None:
    """2 / omega behind a ramp."""
    robot = SimulatedRobot(SimulatedOptions(), None, TICK)
    robot.open(0.0)
    for tick in range(1, 501):
        robot.command((0.0, 0.0, 0.03 - 0.1 * tick * TICK), tick * TICK)
        reading = robot.latest(tick * TICK)
    behind = reading.position[2] - (0.03 - 0.1 * 0.5)
    assert behind / 0.1 == pytest.approx(2.0 / sqrt(50_000.0 / 0.2), rel=0.15)
