"""A robot, an integrator and a shape of another distribution, found by entry points and used in virtual time."""

import json
import os
import subprocess
import sys
from pathlib import Path

from tests.session.packages import install
from tests.session.systems import CONFIGS

TOY = """
from typing import Literal

from pydantic import BaseModel

from weberlink.slave.integrators import IntegrationScheme, MassState
from weberlink.slave.integrators.problem import contact_force
from weberlink.slave.robots.contract import RobotFault, RobotReading, RobotSpec
from weberlink.slave.scenes.shape import SceneShapeSettings


class Slab:
    flat = True

    def __init__(self, height):
        self.height = height

    def clearance(self, point):
        return point[2] - self.height

    def linearise(self, point):
        return ((self.clearance(point), (0.0, 0.0, 1.0)),)


class SlabSettings(SceneShapeSettings):
    shape: Literal["toy_slab"]
    height_m: float

    def solid(self):
        return Slab(self.height_m)


class Euler:
    def __init__(self, body, scene):
        self.body, self.scene = body, scene

    def advance(self, motion, goal, step):
        mass, stiffness, damping = self.body
        x, v, f = motion
        v = tuple(v[i] + step / mass * (stiffness * (goal[i] - x[i]) - damping * v[i] + f[i]) for i in range(3))
        x = tuple(x[i] + step * v[i] for i in range(3))
        return MassState(x, v, contact_force(self.scene.touch(x), v))


EULER = IntegrationScheme("toy:Euler", order=1, l_stable=False)


class ToyRobot:
    COMPUTED = True

    class Options(BaseModel):
        home_m: tuple[float, float, float] = (0.0, 0.0, 0.03)

    def __init__(self, options, scene, tick_period):
        self.spec = RobotSpec("toy", "xyz", 30.0, 1000.0, ((-0.1,) * 3, (0.1,) * 3), 1.0 / tick_period, True)
        self.options, self.scene, self.at, self.goal = options, scene, None, options.home_m

    def open(self, now):
        self.at, self.goal = now, self.options.home_m

    def command(self, position, now):
        self.goal = position

    def latest(self, now):
        if self.at is None:
            raise RobotFault("toy: not open")
        return RobotReading(now, self.goal, self.scene.force(self.goal, 0.001))

    def close(self):
        self.at = None
"""
ENTRY_POINTS = """
[weberlink.robots]
toy = toy:ToyRobot
[weberlink.integrators]
toy_euler = toy:EULER
[weberlink.shapes]
toy_slab = toy:SlabSettings
"""
SESSION = """
import json
import sys
from pathlib import Path
from weberlink.config import load
from weberlink.session.simulation import simulate

SLAB = "{shape: toy_slab, height_m: 0.0, stiffness_n_m: 500}"
felt = []
for robot in ("{driver: toy}", "{driver: simulated, integrator: toy_euler, substeps: 20}"):
    overrides = [f"slave.robot={robot}", f"slave.scene=[{SLAB}]", "link.security=session"]
    _, recorder = simulate(load(Path(sys.argv[1]), overrides), 2.0)
    felt.append(float(recorder.trace.force_n[:, 2].max()))
print(json.dumps(felt))
"""


def test_another_distribution_adds_robot_integrator_and_shape(tmp_path: Path) -> None:
    install(tmp_path, "toy", {"toy": TOY}, ENTRY_POINTS)
    ended = subprocess.run(
        [sys.executable, "-c", SESSION, str(CONFIGS / "loopback.yaml")],
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    assert all(force > 0.5 for force in json.loads(ended.stdout))
