"""The robot keeps the contract, on a ball on three slides over a plane; and its files are those of the program."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from plugins.mujoco.tests.robot.models import gantry, robot, wall
from weberlink.testing.robots import RobotBench, RobotContract
from weberlink.testing.time import virtual_time


class TestMujoco(RobotContract):
    @pytest.fixture
    def bench(self, tmp_path: Path) -> Iterator[RobotBench]:
        made = robot(tmp_path, gantry(wall()), home_m=(0.0, 0.0, 0.03))
        yield RobotBench(made, virtual_time(), (0.01, -0.01, 0.02), (0.01, -0.01, -0.01))
