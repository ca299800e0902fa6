"""What the two computed robots keep beyond the contract: virtual time, bit for bit, exactly."""

from typing import Any

import pytest

from weberlink.geometry.vector import ZERO, Vector, is_finite
from weberlink.slave.robots import load
from weberlink.slave.robots.contract import Robot
from weberlink.slave.scenes.box import BoxCavity
from weberlink.slave.scenes.contact import SceneObject
from weberlink.slave.scenes.plane import PlaneShape
from weberlink.slave.scenes.scene import Scene

TICK = 0.001
every_driver = pytest.mark.parametrize("name", ["point", "simulated"])


def robot_of(name: str, scene: Scene | None = None, **options: Any) -> Robot:
    driver = load(name)
    return driver(driver.Options(**options), scene, TICK)


def ground() -> Scene:
    return Scene([SceneObject(PlaneShape(ZERO, (0.0, 0.0, 1.0)), 500.0)])


@every_driver
def test_readings_follow_now_and_stay_put_within_it(name: str) -> None:
    robot = robot_of(name, ground())
    robot.open(100.0)
    lower, upper = robot.spec.workspace_m
    for tick in range(1, 300):
        now = 100.0 + tick * TICK
        robot.command((0.0, 0.0, 0.03 - 0.0002 * tick), now)
        reading = robot.latest(now)
        assert reading.at == now
        assert robot.latest(now) == reading
        assert is_finite(reading.position)
        assert is_finite(reading.force)
        assert all(a <= p <= b for a, p, b in zip(lower, reading.position, upper, strict=True))
    assert reading.force[2] > 1.0


@every_driver
def test_the_same_calls_give_the_same_run_bit_for_bit(name: str) -> None:
    def run() -> list[tuple[Vector, Vector]]:
        robot = robot_of(name, ground())
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
def test_it_goes_where_it_is_told_on_every_axis(name: str) -> None:
    robot = robot_of(name)
    robot.open(0.0)
    for tick in range(1, 500):
        robot.command((0.01, -0.02, 0.04), tick * TICK)
        reading = robot.latest(tick * TICK)
    assert reading.position == pytest.approx((0.01, -0.02, 0.04))
    assert reading.force == ZERO


@every_driver
def test_a_wall_on_any_side_pushes_back(name: str) -> None:
    room = Scene([SceneObject(BoxCavity(ZERO, (0.08, 0.08, 0.08)), 500.0)])
    robot = robot_of(name, room)
    robot.open(0.0)
    for tick in range(1, 1000):
        robot.command((-0.05, 0.05, 0.05), tick * TICK)
        reading = robot.latest(tick * TICK)
    assert reading.force == pytest.approx((5.0, -5.0, -5.0), rel=0.02)


@every_driver
def test_a_long_gap_is_survived(name: str) -> None:
    robot = robot_of(name, ground())
    robot.open(0.0)
    robot.command((0.0, 0.0, -0.01), TICK)
    reading = robot.latest(3600.0)
    assert reading.at == 3600.0
    assert reading.position[2] == pytest.approx(-0.01, abs=1e-3)


@every_driver
def test_the_sensor_saturates_at_its_range(name: str) -> None:
    """And `reading.force` never says more than the spec."""
    robot = robot_of(name, ground(), force_n=2.0)
    robot.open(0.0)
    for tick in range(1, 300):
        robot.command((0.0, 0.0, -0.03), tick * TICK)
        reading = robot.latest(tick * TICK)
    assert reading.force == pytest.approx((0.0, 0.0, 2.0))


@every_driver
@pytest.mark.parametrize("options", [{"workspace_m": 0.0}, {"home_m": [0, 0, 1]}, {"colour": "red"}, {"force_n": -1}])
def test_wrong_options_are_refused_by_name(name: str, options: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(options))):
        load(name).Options(**options)


def test_an_unknown_driver_names_the_nearest() -> None:
    with pytest.raises(ValueError, match=r"'simulatd'.*nearest is 'simulated'.*point"):
        load("simulatd")
