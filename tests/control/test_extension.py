"""A control scheme of another distribution, found by its entry point, in a process of its own."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.system.packages import install
from weberlink.master.safety import FADE
from weberlink.telemetry.fault import Fault

CONFIGURATION = Path(__file__).parents[2] / "configs" / "loopback.yaml"
ENTRY_POINTS = """[weberlink.control_schemes]
half = toy_scheme:HALF
none = toy_scheme:HALF
ghost = toy_scheme:GHOST
broken = toy_scheme:MISSING
loose = toy_scheme:LOOSE
"""
TOY = """
from weberlink.control.direct import DirectMaster
from weberlink.control.table import Scheme

class HalfMaster(DirectMaster):
    def render(self, force):
        return tuple(0.5 * value for value in force)

class GhostMaster(DirectMaster):
    resumed = 0
    def render(self, force):
        return (0.0, 0.0, 4.0)
    def resume(self, peer_credit):
        GhostMaster.resumed += 1

class Loose:
    def __init__(self, settings): ...

LOOSE = Scheme("toy_scheme:Loose", "weberlink.control.direct:DirectSlave", carries_credit=False, does="nothing")
GHOST = Scheme("toy_scheme:GhostMaster", "weberlink.control.direct:DirectSlave", carries_credit=False, does="pushes")
HALF = Scheme("toy_scheme:HalfMaster", "weberlink.control.direct:DirectSlave", carries_credit=False, does="half force")
"""
RUN = """
import json, sys
from pathlib import Path
from weberlink.control.table import SCHEMES
from weberlink.system.composition.trial import try_out
from weberlink.system.configuration import ConfigurationError, load
from weberlink.system.simulate import build_simulation, simulate
from weberlink.system.check import describe

configuration = load(Path(sys.argv[1]), ["control.scheme=half"])
simulation = build_simulation(configuration)
masters = [simulation.step()[0] for _ in range(2500)]
told = [(record.decoded_z, record.output_z) for record in masters if record.ramping == 0]
told = [entry for entry in told if 0.5 < abs(entry[0]) < 5.0]
FREE = "master.device.script=[{motion: rest, duration_s: 9}]"
haunted = load(Path(sys.argv[1]), ["control.scheme=ghost", FREE, "link.emulate={delay_ms: 20, seed: 0}"])
simulation = build_simulation(haunted)
masters = [simulation.step()[0] for _ in range(1500)]
pushes = [(record.at, record.output_z) for record in masters if record.output_z > 1.0]
ends = next(record.at for record in masters if record.output_z == 0.0 and record.at > pushes[-1][0])
resumed = sys.modules["toy_scheme"].GhostMaster.resumed
summary, _ = simulate(haunted, 1.5)
errors = {}
for name in ("broken", "loose"):
    try:
        try_out(load(Path(sys.argv[1]), [f"control.scheme={name}"]))
    except ConfigurationError as fault:
        errors[name] = str(fault)
json.dump({
    "schemes": list(SCHEMES),
    "ratios": sorted({round(output / decoded, 3) for decoded, output in told}),
    "described": [line for line in describe(configuration) if "half force" in line],
    "errors": errors,
    "pushed_s": pushes[-1][0] - pushes[0][0],
    "largest_n": max(force for _, force in pushes),
    "after_s": ends - pushes[-1][0],
    "left_n": masters[-1].output_z,
    "faults": sorted({int(record.fault) for record in masters}),
    "resumed": resumed,
    "verdict": summary["verdict"],
    "counted": summary["faults"]["master"],
}, sys.stdout)
"""


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = install(tmp_path_factory.mktemp("site"), "toy-scheme", {"toy_scheme": TOY}, ENTRY_POINTS)
    ended = subprocess.run(
        [sys.executable, "-c", RUN, str(CONFIGURATION)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), *sys.path])},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    return json.loads(ended.stdout)  # type: ignore[no-any-return]


def test_an_installed_scheme_renders_the_force_of_a_session(found: dict[str, object]) -> None:
    assert found["ratios"] == [0.5]


def test_a_scheme_that_pushes_without_a_contact_is_stopped(found: dict[str, Any]) -> None:
    """By the law at the output: 90 ms for a round trip of 40 ms, then it falls from 1 N to nothing."""
    assert 0.05 < found["pushed_s"] <= 0.091
    assert 1.0 < found["largest_n"] <= 4.0
    assert found["after_s"] == pytest.approx(FADE, abs=0.005)
    assert found["left_n"] == 0.0


def test_it_is_a_fault_that_is_counted_and_fails_the_session(found: dict[str, Any]) -> None:
    assert found["faults"] == [Fault.NONE, Fault.UNFOUNDED]
    assert found["counted"] == {"unfounded": 1}
    assert found["resumed"] == 1
    assert found["verdict"]["word"] == "failed"
    assert found["verdict"]["causes"][0]["name"] == "unfounded"


def test_a_broken_scheme_is_a_configuration_error(found: dict[str, object]) -> None:
    errors = found["errors"]
    assert isinstance(errors, dict)
    assert errors["broken"].startswith(f"{CONFIGURATION}: control.scheme: control scheme broken")
    assert "control scheme loose of toy-scheme: toy_scheme:Loose has no energy" in errors["loose"]
