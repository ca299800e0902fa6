"""The robot keeps the contract, on a ball on three slides over a plane; and its files are those of the program."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from plugins.mujoco.tests.robot.models import gantry, robot, wall
from tests.program import weberlink
from weberlink.cli.shipped import copy
from weberlink.testing.robots import RobotBench, RobotContract
from weberlink.testing.time import virtual_time

CONFIGS = Path(__file__).parents[2] / "configs"


class TestMujoco(RobotContract):
    @pytest.fixture
    def bench(self, tmp_path: Path) -> Iterator[RobotBench]:
        made = robot(tmp_path, gantry(wall()), home_m=(0.0, 0.0, 0.03))
        yield RobotBench(made, virtual_time(), (0.01, -0.01, 0.02), (0.01, -0.01, -0.01))


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.stem)
def test_a_shipped_file_runs_from_a_copy(path: Path, tmp_path: Path) -> None:
    written = copy(path.stem, tmp_path)
    (model,) = {each for each in written if each.suffix == ".xml"}
    assert model.read_bytes() == (CONFIGS / "mujoco" / model.name).read_bytes()
    ended = weberlink("simulate", tmp_path / path.name, "--duration", 0.3)
    assert (ended.status, ended.errors) == (0, "")
