"""The kernel's robots keep the contract."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from weberlink.geometry.vector import ZERO
from weberlink.slave.robots import BUILT_IN, load
from weberlink.slave.scenes.contact import SceneObject
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.solids import PlaneShape
from weberlink.testing.robots import RobotBench, RobotContract
from weberlink.testing.time import TICK, virtual_time

GROUND = 500.0  # [N/m]
COMPUTED = ("point", "simulated")
SLIDERS = """
<mujoco><option timestep="0.001"/><worldbody>
<geom name="ground" type="plane" size="1 1 0.1" solref="-500 -20" solimp="0.99 0.99 0.001"/>
<body pos="0 0 0.03">
<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="slide" axis="0 0 1"/>
<geom type="sphere" size="0.001" mass="0.1"/><site name="tip"/></body>
</worldbody></mujoco>
"""


def test_every_built_in_driver_is_tried() -> None:
    assert {*COMPUTED, "mujoco"} == set(BUILT_IN)


class TestComputedRobots(RobotContract):
    @pytest.fixture(params=COMPUTED)
    def bench(self, request: pytest.FixtureRequest) -> Iterator[RobotBench]:
        ground = Scene([SceneObject(PlaneShape(ZERO, (0.0, 0.0, 1.0)), GROUND)])
        driver = load(request.param)
        robot = driver(driver.Options(), ground, TICK)
        yield RobotBench(robot, virtual_time(), (0.01, -0.01, 0.02), (0.01, -0.01, -0.01))


class TestMujoco(RobotContract):
    @pytest.fixture
    def bench(self, tmp_path: Path) -> Iterator[RobotBench]:
        model = tmp_path / "sliders.xml"
        model.write_text(SLIDERS)
        driver = load("mujoco")
        robot = driver(driver.Options(model=model), None, TICK)
        yield RobotBench(robot, virtual_time(), (0.01, -0.01, 0.02), (0.01, -0.01, -0.01))
