"""An integrator, a shape and a control scheme of another distribution, found by entry points."""

from pathlib import Path

from tests.session.packages import install, said
from tests.session.systems import CONFIGS

TOY = """
from typing import Literal

from weberlink.control.contract import MasterControl
from weberlink.control.table import Scheme
from weberlink.slave.integrators import IntegrationScheme, MassState
from weberlink.slave.integrators.problem import contact_force
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


class HalfMaster(MasterControl):
    def render(self, force):
        return tuple(0.5 * value for value in force)


class Loose:
    def __init__(self, settings): ...


LOOSE = Scheme("toy:Loose", "weberlink.control.contract:SlaveControl", carries_credit=False, does="nothing")
HALF = Scheme("toy:HalfMaster", "weberlink.control.contract:SlaveControl", carries_credit=False, does="half force")
"""
ENTRY_POINTS = """
[weberlink.integrators]
toy_euler = toy:EULER
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
from weberlink.config import ConfigurationError, load
from weberlink.session.advice import dry_run
from weberlink.session.simulation import build_simulation

SLAB = "{shape: toy_slab, height_m: 0.0, stiffness_n_m: 500}"
errors, robot = {}, "slave.robot={driver: simulated, integrator: toy_euler, substeps: 20}"
overrides = [robot, f"slave.scene=[{SLAB}]", "link.security=session", "control.scheme=half"]
master, _ = build_simulation(load(Path(sys.argv[1]), overrides)).advance(2000)
decoded, output = master["decoded"][:, 2], master["output"][:, 2]
told = (master["ramping"] == 0) & (0.5 < abs(decoded)) & (abs(decoded) < 5.0)
ratios = set((output[told] / decoded[told]).round(3).tolist())
for name in ("broken", "loose"):
    try:
        dry_run(load(Path(sys.argv[1]), [f"control.scheme={name}"]))
    except ConfigurationError as fault:
        errors[name] = str(fault)
json.dump({"felt": float(decoded.max()), "ratios": sorted(ratios), "errors": errors}, sys.stdout)
"""


def test_another_distribution_adds_integrator_shape_and_scheme(tmp_path: Path) -> None:
    folder, file = install(tmp_path, "toy", {"toy": TOY}, ENTRY_POINTS), CONFIGS / "loopback.yaml"
    found = said(folder, SESSION, str(file))
    assert found["felt"] > 0.5
    assert found["ratios"] == [0.5]
    assert found["errors"]["broken"].startswith(f"{file}: control.scheme: control scheme broken of toy")
    assert "control scheme loose of toy: toy:Loose does not inherit from weberlink.control" in found["errors"]["loose"]
