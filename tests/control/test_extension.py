"""A control scheme of another distribution, found by its entry point, in a process of its own."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.system.packages import install

CONFIGURATION = Path(__file__).parents[2] / "configs" / "loopback.yaml"
ENTRY_POINTS = """[weberlink.control_schemes]
half = toy_scheme:HALF
none = toy_scheme:HALF
broken = toy_scheme:MISSING
loose = toy_scheme:LOOSE
"""
TOY = """
from weberlink.control.direct import DirectMaster
from weberlink.control.table import Scheme

class HalfMaster(DirectMaster):
    active = "half"
    def render(self, force):
        return tuple(0.5 * value for value in force)

class Loose:
    def __init__(self, settings): ...

LOOSE = Scheme("toy_scheme:Loose", "weberlink.control.direct:DirectSlave", carries_credit=False, does="nothing")
HALF = Scheme("toy_scheme:HalfMaster", "weberlink.control.direct:DirectSlave", carries_credit=False, does="half force")
"""
RUN = """
import json, sys
from pathlib import Path
from weberlink.control.table import SCHEMES
from weberlink.system.composition.trial import try_out
from weberlink.system.configuration import ConfigurationError, load
from weberlink.system.simulate import build_simulation
from weberlink.system.check import describe

configuration = load(Path(sys.argv[1]), ["control.scheme=half"])
simulation = build_simulation(configuration)
masters = [simulation.step()[0] for _ in range(2500)]
told = [(record.decoded_z, record.output_z, record.control) for record in masters if record.ramping == 0]
told = [entry for entry in told if 0.5 < abs(entry[0]) < 5.0]
errors = {}
for name in ("broken", "loose"):
    try:
        try_out(load(Path(sys.argv[1]), [f"control.scheme={name}"]))
    except ConfigurationError as fault:
        errors[name] = str(fault)
json.dump({
    "schemes": list(SCHEMES),
    "ratios": sorted({round(output / decoded, 3) for decoded, output, _ in told}),
    "codes": sorted({code for *_, code in told}),
    "described": [line for line in describe(configuration) if "half force" in line],
    "errors": errors,
}, sys.stdout)
"""


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, object]:
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


def test_its_place_after_the_built_in_ones_is_recorded(found: dict[str, object]) -> None:
    assert found["schemes"] == ["none", "tdpa", "mmt", "auto", "broken", "half", "loose"]
    assert found["codes"] == [5]


def test_check_describes_an_installed_scheme(found: dict[str, object]) -> None:
    assert found["described"]


def test_a_broken_scheme_is_a_configuration_error(found: dict[str, object]) -> None:
    errors = found["errors"]
    assert isinstance(errors, dict)
    assert errors["broken"].startswith(f"{CONFIGURATION}: control.scheme: control scheme broken")
    assert "control scheme loose of toy-scheme: toy_scheme:Loose has no active" in errors["loose"]
