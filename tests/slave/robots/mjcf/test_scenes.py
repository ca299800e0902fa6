"""The two shipped models, driven as their configuration files say."""

from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import pytest
import yaml

pytest.importorskip("mujoco", reason="needs mujoco (extra: mujoco)")

from tests.slave.robots.mjcf.models import TICK, lead
from weberlink.geometry.vector import Vector, distance, norm
from weberlink.slave.robots.mjcf.driver import MujocoRobot

CONFIGS = Path(__file__).parents[4] / "configs"
FELT = 2000.0 / 3.0
"""Control of 2000 N/m and contact of 1000 N/m in series."""


@cache
def named(file: str) -> dict[str, Any]:
    robot: dict[str, Any] = yaml.safe_load((CONFIGS / file).read_text())["slave"]["robot"]
    assert robot["driver"] == "mujoco"
    return {name: value for name, value in robot.items() if name != "driver"} | {"model": CONFIGS / robot["model"]}


@pytest.fixture(scope="module")
def arm() -> MujocoRobot:
    return MujocoRobot(MujocoRobot.Options(**named("mujoco-arm.yaml")), None, TICK)


@pytest.mark.parametrize("depth", [0.002, 0.006])
def test_the_plane_pushes_up(arm: MujocoRobot, depth: float) -> None:
    force = lead(arm, (0.05, -0.05, 0.045), (0.05, -0.05, 0.005), (0.05, -0.05, -depth)).force
    assert force == pytest.approx((0.0, 0.0, FELT * depth), rel=0.01, abs=1e-3)


CONTACTS = [
    ("mujoco-arm.yaml", (0.0, 0.045, -0.006)),
    ("mujoco-arm.yaml", (-0.033, 0.0, 0.002)),
    ("mujoco-arm.yaml", (0.033, 0.0, 0.0)),
    ("mujoco-peg.yaml", (0.03, 0.01, 0.03)),
    ("mujoco-peg.yaml", (0.05, 0.01, 0.01)),
]


@pytest.mark.parametrize(("file", "goal"), CONTACTS)
def test_a_command_that_rests_feeds_no_energy(file: str, goal: Vector) -> None:
    """Thrown at a surface, with ticks that come early and late: it never gets further away, and comes to rest."""
    robot = MujocoRobot(MujocoRobot.Options(**named(file)), None, TICK)
    jitter = Random(7)
    entrance = (0.0, 0.0, 0.0) if file == "mujoco-peg.yaml" and goal[2] < 0.02 else (goal[0], goal[1], 0.045)
    lead(robot, (0.0, entrance[1], entrance[2]), entrance if file == "mujoco-arm.yaml" else (0.0, goal[1], goal[2]))
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
