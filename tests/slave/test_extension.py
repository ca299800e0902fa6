"""A device, a robot, an integrator, a shape and a control scheme of another distribution, found by entry points."""

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

from weberlink.control.ends import MasterControl
from weberlink.control.table import Scheme
from weberlink.master.devices.hand_device import HandDevice
from weberlink.master.devices.hand_options import HandDeviceOptions
from weberlink.slave.integrators import IntegrationScheme, Integrator, MassState
from weberlink.slave.integrators.problem import contact_force
from weberlink.slave.robots.computed import ComputedRobot
from weberlink.slave.robots.contract import RobotSpec
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


class Formal(Euler, Integrator): ...


FORMAL = IntegrationScheme("toy:Formal", order=1, l_stable=False)


class ToyRobot(ComputedRobot):
    class Options(BaseModel):
        home_m: tuple[float, float, float] = (0.0, 0.0, 0.03)

    def __init__(self, options, scene, tick_period):
        spec = RobotSpec("toy", "xyz", 30.0, 1000.0, ((-0.1,) * 3, (0.1,) * 3), 1.0 / tick_period, True)
        super().__init__(spec, options.home_m)
        self.scene = scene

    def _reset(self):
        self.resets = getattr(self, "resets", 0) + 1

    def _advance(self, commanded, elapsed):
        return commanded, self.scene.force(commanded, elapsed), (0.0, 0.0, 0.0)


class ToyHand(HandDevice):
    class Options(HandDeviceOptions):
        depth_m: float = 0.01

    def __init__(self, options, tick_period):
        super().__init__("toy_hand", options, self.means, tick_period)
        self.depth = options.depth_m

    def means(self, now):
        return (0.0, 0.0, -self.depth), False

    def command(self, force, now):
        commanded.append(force)
        super().command(force, now)


commanded = []


class HalfMaster(MasterControl):
    def render(self, force):
        return tuple(0.5 * value for value in force)


class Loose:
    def __init__(self, settings): ...


LOOSE = Scheme("toy:Loose", "weberlink.control.ends:SlaveControl", carries_credit=False, does="nothing")
HALF = Scheme("toy:HalfMaster", "weberlink.control.ends:SlaveControl", carries_credit=False, does="half force")
"""
ENTRY_POINTS = """
[weberlink.devices]
toy_hand = toy:ToyHand
[weberlink.robots]
toy = toy:ToyRobot
[weberlink.integrators]
toy_euler = toy:EULER
toy_formal = toy:FORMAL
[weberlink.shapes]
toy_slab = toy:SlabSettings
[weberlink.control_schemes]
half = toy:HALF
none = toy:HALF
broken = toy:MISSING
loose = toy:LOOSE
"""
SESSION = """
import json
import sys
from pathlib import Path
from toy import commanded
from weberlink.config import ConfigurationError, load
from weberlink.session.advice import dry_run
from weberlink.session.simulation import build_simulation

SLAB = "{shape: toy_slab, height_m: 0.0, stiffness_n_m: 500}"
felt, ratios, errors = [], set(), {}
SIMULATED = "slave.robot={driver: simulated, integrator: toy_%s, substeps: 20}"
TOYS = (
    ["slave.robot={driver: toy}"],
    [SIMULATED % "euler"],
    [SIMULATED % "formal", "master.device={driver: toy_hand}"],
)
for toys in TOYS:
    overrides = [*toys, f"slave.scene=[{SLAB}]", "link.security=session", "control.scheme=half"]
    simulation = build_simulation(load(Path(sys.argv[1]), overrides))
    master, _ = simulation.advance(2000)
    decoded, output = master["decoded"][:, 2], master["output"][:, 2]
    felt.append(float(decoded.max()))
    told = (master["ramping"] == 0) & (0.5 < abs(decoded)) & (abs(decoded) < 5.0)
    ratios |= set((output[told] / decoded[told]).round(3).tolist())
for name in ("broken", "loose"):
    try:
        dry_run(load(Path(sys.argv[1]), [f"control.scheme={name}"]))
    except ConfigurationError as fault:
        errors[name] = str(fault)
json.dump({"felt": felt, "commanded": len(commanded), "ratios": sorted(ratios), "errors": errors}, sys.stdout)
"""


def test_another_distribution_adds_device_robot_integrator_shape_and_scheme(tmp_path: Path) -> None:
    folder, file = install(tmp_path, "toy", {"toy": TOY}, ENTRY_POINTS), CONFIGS / "loopback.yaml"
    ended = subprocess.run(
        [sys.executable, "-c", SESSION, str(file)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), *sys.path])},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    found = json.loads(ended.stdout)
    assert all(force > 0.5 for force in found["felt"])
    assert found["commanded"] >= 2000
    assert found["ratios"] == [0.5]
    assert found["errors"]["broken"].startswith(f"{file}: control.scheme: control scheme broken of toy")
    assert "control scheme loose of toy: toy:Loose does not inherit from weberlink.control" in found["errors"]["loose"]
