"""What docs/devices/mujoco.md shows works as it stands there."""

import re
from pathlib import Path

import pytest
import yaml

pytest.importorskip("mujoco", reason="needs mujoco (extra: mujoco)")

from tests.slave.robots.mjcf.models import TICK, lead
from weberlink.slave.robots.mjcf.driver import MujocoRobot

PAGE = (Path(__file__).parents[4] / "docs" / "devices" / "mujoco.md").read_text()


def block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)
    assert found is not None
    return found[1]


def test_the_file_of_one_s_own_is_felt(tmp_path: Path) -> None:
    options = yaml.safe_load(block("yaml"))["slave"]["robot"]
    assert options.pop("driver") == "mujoco"
    path = tmp_path / options.pop("model")
    path.write_text(block("xml"))
    robot = MujocoRobot(MujocoRobot.Options(model=path, **options), None, TICK)
    assert lead(robot, (0.02, -0.02, 0.04)).force == (0.0, 0.0, 0.0)
    table, box = (
        lead(robot, (*at, 0.03), (*at, height)).force for at, height in (((-0.03, 0.0), -0.01), ((0.03, 0.0), 0.01))
    )
    for force in (table, box):
        assert force[2] > 3.0
        assert abs(force[0]) + abs(force[1]) < 0.1 * force[2]
