"""The kernel's robots keep the contract."""

from collections.abc import Iterator

import pytest

from weberlink.geometry.vector import ZERO
from weberlink.slave.robots import BUILT_IN, ROBOTS
from weberlink.slave.scenes.contact import SceneObject
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.solids import PlaneShape
from weberlink.testing.robots import RobotBench, RobotContract
from weberlink.testing.time import TICK, virtual_time

GROUND = 500.0  # [N/m]
COMPUTED = ("point", "simulated")


def test_every_built_in_driver_is_tried() -> None:
    assert set(COMPUTED) == set(BUILT_IN)


class TestComputedRobots(RobotContract):
    @pytest.fixture(params=COMPUTED)
    def bench(self, request: pytest.FixtureRequest) -> Iterator[RobotBench]:
        ground = Scene([SceneObject(PlaneShape(ZERO, (0.0, 0.0, 1.0)), GROUND)])
        driver = ROBOTS.load(request.param)
        robot = driver(driver.Options(), ground, TICK)
        yield RobotBench(robot, virtual_time(), (0.01, -0.01, 0.02), (0.01, -0.01, -0.01))
