from math import exp, sqrt

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec.vector import ZERO, is_finite
from slave.robots.contract import RobotFault
from slave.robots.simulated import SUBSTEPS_MOST, SimulatedOptions, SimulatedRobot
from slave.scenes.contact import SceneObject
from slave.scenes.plane import Plane
from slave.scenes.scene import Scene

TICK = 0.001


def wall(stiffness: float, damping: float | None = None) -> Scene:
    return Scene([SceneObject(Plane(ZERO, (0.0, 0.0, 1.0)), stiffness, None, damping)])


def test_against_a_wall_it_rests_where_both_springs_agree() -> None:
    robot = SimulatedRobot(SimulatedOptions(stiffness_n_m=2000.0), wall(1000.0), TICK)
    robot.open(0.0)
    for tick in range(1, 1001):
        robot.command((0.0, 0.0, -0.01), tick * TICK)
        reading = robot.latest(tick * TICK)
    assert reading.position[2] == pytest.approx(-0.01 * 2000.0 / 3000.0, abs=1e-9)
    assert reading.force == pytest.approx((0.0, 0.0, 1000.0 * 0.02 / 3.0), abs=1e-5)


def test_a_free_step_is_that_of_the_critically_damped_oscillator() -> None:
    """x(t) = x_d + (x_0 - x_d)(1 + w t) exp(-w t), to the first order of the integrator."""
    robot = SimulatedRobot(SimulatedOptions(), None, TICK)
    omega = sqrt(50_000.0 / 0.2)
    robot.open(0.0)
    robot.command((0.0, 0.0, 0.02), 0.0)
    for tick in range(1, 21):
        x = robot.latest(tick * TICK).position[2]
        t = omega * tick * TICK
        assert x == pytest.approx(0.02 + 0.01 * (1.0 + t) * exp(-t), abs=0.01 * 0.05)


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


@settings(max_examples=60)
@given(
    mass=st.floats(0.01, 20.0),
    gain=st.floats(10.0, 1e6),
    damping=st.one_of(st.none(), st.floats(0.1, 1000.0)),
    stiffness=st.floats(10.0, 1e6),
    surface=st.one_of(st.none(), st.floats(0.0, 200.0)),
)
def test_it_is_stable_or_it_is_refused(
    mass: float, gain: float, damping: float | None, stiffness: float, surface: float | None
) -> None:
    options = SimulatedOptions(mass_kg=mass, stiffness_n_m=gain, damping_n_s_m=damping)
    try:
        robot = SimulatedRobot(options, wall(stiffness, surface), TICK)
    except ValueError as error:
        assert "mass_kg" in str(error)
        return
    assert 1 <= robot.substeps <= SUBSTEPS_MOST
    robot.open(0.0)
    for tick in range(1, 201):
        robot.command((0.0, 0.0, -0.01), tick * TICK)
        reading = robot.latest(tick * TICK)
        assert is_finite(reading.position)
        assert abs(reading.position[2]) < 0.1


def test_the_substeps_follow_the_stated_rule_and_are_told() -> None:
    robot = SimulatedRobot(SimulatedOptions(mass_kg=0.1, stiffness_n_m=2e4), wall(1e5), TICK)
    assert robot.substeps == 6  # 1 ms sqrt(1.2e5 / 0.1) / 0.2 = 5.5
    assert "6 substeps" in robot.description()
    assert "4.5 ms" in robot.description()


def test_what_no_step_can_make_stable_is_refused() -> None:
    with pytest.raises(ValueError, match=r"mass_kg: 0.0001 kg against"):
        SimulatedRobot(SimulatedOptions(mass_kg=1e-4, stiffness_n_m=1e7), wall(1e6), TICK)


def test_an_absurd_command_is_a_fault_of_the_robot() -> None:
    robot = SimulatedRobot(SimulatedOptions(), wall(500.0), TICK)
    robot.open(0.0)
    robot.command((1e308, 0.0, 0.0), 0.0)
    with pytest.raises(RobotFault, match="position is not finite"):
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
