"""Small MJCF models for tests, and robots made of them."""

from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

from weberlink.geometry.vector import Vector
from weberlink.slave.robots.contract import RobotReading
from weberlink_mujoco.robot.driver import MujocoRobot

TICK = 0.001
MASS = 0.2  # of the gantry [kg]; a third of it sits on the sensor
RADIUS = 0.005
GROUND = 500.0  # stiffness of every contact with the gantry [N/m]

SLIDES = """
<joint name="x" type="slide" axis="1 0 0"/>
<joint name="y" type="slide" axis="0 1 0"/>
<joint name="z" type="slide" axis="0 0 1"/>"""


def wall(normal: Vector = (0.0, 0.0, 1.0), distance: float = 0.0) -> str:
    """A plane that the tip meets where `normal` . tip = -`distance` [m], as a spring of GROUND."""
    x, y, z = normal
    away = -distance - RADIUS
    return (
        f'<geom type="plane" size="1 1 0.1" pos="{away * x} {away * y} {away * z}" zaxis="{x} {y} {z}" priority="1" '
        f'condim="1" solref="{-GROUND * 0.95 / MASS:g} -20" solimp="0.05 0.05 0.001"/>'
    )


def gantry(surroundings: str = "", *, joints: str = SLIDES, tool: str = "", timestep: float = TICK) -> str:
    """A ball with the site `tip` in its middle, on slides, under a force sensor that is turned."""
    return f"""
    <mujoco>
      <option timestep="{timestep}" cone="elliptic" gravity="1 -2 -9.81"/>
      <worldbody>
        {surroundings}
        <body name="carriage">
          {joints}
          <geom type="box" pos="0 0 0.05" size="0.01 0.01 0.01" mass="{MASS * 2 / 3}" contype="0" conaffinity="0"/>
          <body name="tool">
            <geom name="ball" size="{RADIUS}" mass="{MASS / 3}" condim="1"/>
            <site name="flange" pos="0 0 0.02" euler="30 40 50"/>
            <site name="tip"/>
            {tool}
          </body>
        </body>
      </worldbody>
      <sensor><force name="wrist" site="flange"/><accelerometer name="shaken" site="tip"/></sensor>
    </mujoco>"""


def robot(folder: Path, text: str, **options: Any) -> MujocoRobot:
    path = folder / "model.xml"
    path.write_text(text)
    return MujocoRobot(MujocoRobot.Options(model=path, **options), None, TICK)


def hold(robot: MujocoRobot, goal: Vector, ticks: int, start: float = 0.0) -> RobotReading:
    """The reading after so many ticks [1] under a command [m], from `start` [s] on."""
    return readings(robot, (goal for _ in range(ticks)), start)[-1]


def readings(robot: MujocoRobot, goals: Iterable[Vector], start: float = 0.0) -> list[RobotReading]:
    found: list[RobotReading] = []
    for tick, goal in enumerate(goals, 1):
        now = start + tick * TICK
        robot.command(goal, now)
        found.append(robot.latest(now))
    return found


def lead(robot: MujocoRobot, *goals: Vector, ticks: int = 300) -> RobotReading:
    """Open it and lead it along straight lines, and let it rest at the last goal for as long again."""
    robot.open(0.0)
    way = [robot.latest(0.0).position, *goals, goals[-1]]
    now = 0.0
    for start, goal in pairwise(way):
        for tick in range(1, ticks + 1):
            share = tick / ticks
            x, y, z = (a + share * (b - a) for a, b in zip(start, goal, strict=True))
            now += TICK
            robot.command((x, y, z), now)
            reading = robot.latest(now)
    return reading
