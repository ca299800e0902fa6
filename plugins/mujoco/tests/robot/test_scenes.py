"""The shipped models, driven as their configuration files say."""

from pathlib import Path
from random import Random

import pytest
import yaml

from plugins.mujoco.tests.robot.models import TICK, lead
from weberlink.geometry.vector import Vector, distance, norm
from weberlink_mujoco.robot.driver import MujocoRobot

CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.mark.parametrize(
    ("file", "goal"),
    [
        ("mujoco-arm.yaml", (0.0, 0.045, -0.006)),
        ("mujoco-arm.yaml", (0.033, 0.0, 0.0)),
        ("mujoco-peg.yaml", (0.03, 0.01, 0.03)),
    ],
)
def test_a_command_that_rests_feeds_no_energy(file: str, goal: Vector) -> None:
    """Thrown at a surface, with ticks that come early and late: it never gets further away, and comes to rest."""
    options = yaml.safe_load((CONFIGS / file).read_text())["slave"]["robot"]
    assert options.pop("driver") == "mujoco"
    robot = MujocoRobot(MujocoRobot.Options(**options | {"model": CONFIGS / options["model"]}), None, TICK)
    jitter = Random(7)
    above = 0.045 if file == "mujoco-arm.yaml" else goal[2]
    lead(robot, (0.0, goal[1], above), (goal[0] if file == "mujoco-arm.yaml" else 0.0, goal[1], above))
    now = 10.0
    robot.command(goal, now)
    start = distance(robot.latest(now).position, goal)
    moved = []
    for _ in range(1500):
        now += TICK * jitter.uniform(0.2, 1.9)
        moved.append(robot.latest(now))
    assert max(distance(reading.position, goal) for reading in moved) < start + 0.001
    rest = moved[-1]
    assert norm(rest.force) > 1.0
    for reading in moved[-300:]:
        assert distance(reading.position, rest.position) < 1e-6
        assert distance(reading.force, rest.force) < 0.01
