"""The kernel's robots keep the contract, and are virtual to the last bit; and a tool of several points."""

from collections.abc import Iterator
from math import cos, inf, nan, radians, sin
from typing import Any

import pytest
from hypothesis import given, strategies as st

from tests.examples import examples
from tests.slave.scenes.solids import GROUND, wall
from weberlink.geometry.rotation import Quaternion, turned
from weberlink.geometry.vector import ZERO, Vector, add, scale
from weberlink.slave.robots import BUILT_IN, ROBOTS
from weberlink.slave.robots.contract import Robot, RobotFault, RobotReading
from weberlink.slave.robots.simulated import SimulatedOptions, SimulatedRobot
from weberlink.slave.scenes.scene import Scene, SceneObject
from weberlink.slave.scenes.shape import SphereShape
from weberlink.testing.robots import RobotBench, RobotContract
from weberlink.testing.time import virtual_time

TICK = 0.001
every_driver = pytest.mark.parametrize("name", BUILT_IN)


def robot_of(name: str, scene: Scene | None = None, **options: Any) -> Robot:
    driver = ROBOTS[name]
    return driver(driver.Options(**options), scene, TICK)


class TestComputedRobots(RobotContract):
    @pytest.fixture(params=BUILT_IN)
    def bench(self, request: pytest.FixtureRequest) -> Iterator[RobotBench]:
        yield RobotBench(robot_of(request.param, wall()), virtual_time(), (0.01, -0.01, 0.02), (0.01, -0.01, -0.01))


@every_driver
def test_runs_are_reproducible(name: str) -> None:
    def run() -> list[tuple[Vector, Vector]]:
        robot = robot_of(name, wall())
        readings = []
        for _ in range(2):  # a second session starts as afresh
            robot.open(0.0)
            now = 0.0
            for tick in range(1, 200):
                now += TICK * (1.0 + 0.3 * (tick % 3)) + (0.02 if tick == 50 else 0.0)
                robot.command((0.0001 * tick, 0.0, 0.03 - 0.0003 * tick), now)
                reading = robot.latest(now)
                readings.append((reading.position, reading.force))
            robot.close()
        assert readings[:199] == readings[199:]
        return readings

    assert run() == run()


@every_driver
def test_the_sensor_saturates_at_its_range(name: str) -> None:
    """And `reading.force` never says more than the spec."""
    robot = robot_of(name, wall(), force_n=2.0)
    robot.open(0.0)
    for tick in range(1, 300):
        robot.command((0.0, 0.0, -0.03), tick * TICK)
        reading = robot.latest(tick * TICK)
    assert reading.force == pytest.approx((0.0, 0.0, 2.0))


@every_driver
@pytest.mark.parametrize("options", [{"workspace_m": 0.0}, {"home_m": [0, 0, 1]}, {"colour": "red"}, {"force_n": -1}])
def test_wrong_options_are_refused_by_name(name: str, options: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(options))):
        ROBOTS[name].Options(**options)


@given(st.floats(10.0, 1e7), st.floats(10.0, 1e6), st.floats(1e-6, 0.05))
@examples(40)
def test_a_point_feels_the_softer_of_wall_and_coupling_and_its_tip_is_where_its_spring_holds_it(
    stiffness: float, coupling: float, depth: float
) -> None:
    robot = robot_of("point", wall(stiffness), stiffness_n_m=coupling, force_n=10.0)
    robot.open(0.0)
    robot.command((0.0, 0.0, 0.001), TICK)
    robot.latest(TICK)
    robot.command((0.002, 0.0, -depth), 2.0 * TICK)
    reading = robot.latest(2.0 * TICK)
    felt = min(10.0, min(stiffness, coupling) * depth)
    assert reading.force == pytest.approx((0.0, 0.0, felt))
    assert reading.position == pytest.approx((0.002, 0.0, -depth + felt / coupling))
    robot.command((0.0, 0.0, 0.001), 3.0 * TICK)
    assert robot.latest(3.0 * TICK)[1:3] == ((0.0, 0.0, 0.001), ZERO)


def test_unstable_choice_error_names_alternative() -> None:
    options = SimulatedOptions(mass_kg=1e-4, stiffness_n_m=1e7, integrator="semi_implicit")
    with pytest.raises(ValueError, match=r"integrator: semi_implicit is unstable .* 0.0001 kg .* integrator: auto"):
        SimulatedRobot(options, wall(1e6), TICK)


def test_extreme_command_is_a_robot_fault() -> None:
    robot = SimulatedRobot(SimulatedOptions(), wall(), TICK)
    robot.open(0.0)
    robot.command((1e308, 0.0, 0.0), 0.0)
    with pytest.raises(RobotFault, match="motion is not finite"):
        robot.latest(TICK)


# A tool of several points.


def held(made: Any, position: Vector, orientation: Quaternion) -> RobotReading:
    now = made.latest(0.0).at + TICK
    made.command(position, now)
    made.point(orientation, now)
    reading: RobotReading = made.latest(now)
    return reading


def ball_on_ground() -> Scene:
    return Scene([SceneObject(GROUND, 500.0), SceneObject(SphereShape((0.01, 0.0, -0.02), 0.03), 700.0)])


axes = st.sampled_from([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.0, -0.8, 0.6)])


@examples(50)
@given(axes, st.floats(-170.0, 170.0), st.floats(-0.02, 0.03))
def test_torque_is_that_of_forces_at_points(axis: Vector, angle: float, height: float) -> None:
    """Against one plain scene per point."""
    points = [(0.02, 0.01, -0.01), (-0.02, 0.0, 0.0), (0.0, -0.03, 0.01)]
    made = robot_of("point", ball_on_ground(), tool={"points_m": points}, force_n=1e3)
    made.open(0.0)
    orientation = (cos(radians(angle) / 2.0), *scale(axis, sin(radians(angle) / 2.0)))
    above, tip = (0.0, 0.0, 0.05), (0.005, -0.003, height)
    force = torque = ZERO
    held(made, above, orientation)
    reading = held(made, tip, orientation)
    for point in points:
        single, lever = ball_on_ground(), turned(orientation, point)
        single.force(add(above, lever), TICK)
        f = single.force(add(tip, lever), TICK)
        (x, y, z), (a, b, c) = lever, f
        force, torque = add(force, f), add(torque, (y * c - z * b, z * a - x * c, x * b - y * a))
    assert reading.force == pytest.approx(force, abs=1e-9)
    assert reading.torque == pytest.approx(torque, abs=1e-9)


@pytest.mark.parametrize("orientation", [(0.0,) * 4, (nan, 0.0, 0.0, 0.0), (inf, 0.0, 0.0, 0.0)])
def test_invalid_orientation_is_a_value_error(orientation: Quaternion) -> None:
    made: Any = robot_of("point", wall(), tool={"points_m": [(0.03, 0.0, 0.0), (-0.03, 0.0, 0.0)]})
    with pytest.raises(ValueError, match="point: commanded an orientation that is none"):
        made.point(orientation, TICK)
