"""The sample of the force channel: what is felt, and the command that belongs to it."""

from math import inf, pi, sin
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.compiled import replaces_methods
from tests.examples import examples
from weberlink.geometry.vector import ZERO, Vector
from weberlink.slave.robot_port import ContactForce
from weberlink.slave.robots.contract import RobotReading
from weberlink.slave.robots.simulated import SimulatedOptions, SimulatedRobot
from weberlink.slave.scenes.contact import SceneObject
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.solids import PlaneShape

pytestmark = replaces_methods  # `ShowsAll` stands in for a compiled class
TICK = 1e-3
UP = (0.0, 0.0, 1.0)


class ShowsAll:
    """The part of the port that a sample reads, once the force has faded in."""

    def shown(self, force: Vector) -> Vector:
        return force


def contact(stiffness: float) -> ContactForce:
    port: Any = ShowsAll()
    return ContactForce(port, stiffness)


@given(
    wall=st.sampled_from([500.0, 1e4, 1e7]),
    mass=st.sampled_from([0.005, 0.1, 1.0]),
    coupling=st.floats(500.0, 5000.0),
    frequency=st.floats(1.0, 10.0),
)
@examples(20)
def test_samples_of_a_moving_robot_lie_on_the_static_line_of_the_wall(
    wall: float, mass: float, coupling: float, frequency: float
) -> None:
    """At any speed, they are the force of two springs in series, at a command that no lag has touched."""
    robot = SimulatedRobot(
        SimulatedOptions(mass_kg=mass, stiffness_n_m=coupling, force_n=1e4),
        Scene([SceneObject(PlaneShape(ZERO, UP), wall)]),
        TICK,
    )
    felt, series = contact(coupling), wall * coupling / (wall + coupling)
    robot.open(0.0)
    touched, lag = 0, 0.0
    for tick in range(1, 1001):
        command = (0.0, 0.0, 0.02 * sin(2.0 * pi * frequency * tick * TICK))
        robot.command(command, tick * TICK)
        felt.take(robot.latest(tick * TICK))
        value, rest, most = felt.sample()
        assert most == inf
        if value == ZERO:
            continue
        touched += 1
        assert value[2] == pytest.approx(-series * rest[2], rel=1e-6, abs=1e-6 * wall * 1e-3)
        lag = max(lag, abs(value[2] + series * command[2]))
    assert touched > 10
    assert lag > 0.05  # [N] off the line, if paired with the command


def test_an_ideal_robot_is_at_its_command() -> None:
    felt = contact(inf)
    felt.take(RobotReading(0.0, (0.1, 0.2, 0.3), (1.0, 2.0, 3.0)))
    assert felt.sample() == ((1.0, 2.0, 3.0), (0.1, 0.2, 0.3), inf)


def test_a_force_that_is_not_finite_is_named() -> None:
    assert contact(inf).complaint(RobotReading(0.0, ZERO, ZERO)) is None
    assert "nan" in (contact(inf).complaint(RobotReading(0.0, ZERO, (0.0, float("nan"), 0.0))) or "")
