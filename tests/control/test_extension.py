"""A control scheme of another distribution, found by its entry point, in a process of its own."""

import json
import os
import subprocess
import sys
from pathlib import Path

from tests.session.packages import install

CONFIGURATION = Path(__file__).parents[2] / "configs" / "loopback.yaml"
ENTRY_POINTS = """[weberlink.control_schemes]
half = toy_scheme:HALF
none = toy_scheme:HALF
broken = toy_scheme:MISSING
loose = toy_scheme:LOOSE
"""
TOY = """
from weberlink.control.ends import MasterControl
from weberlink.control.table import Scheme

class HalfMaster(MasterControl):
    def render(self, force):
        return tuple(0.5 * value for value in force)

class Loose:
    def __init__(self, settings): ...

LOOSE = Scheme("toy_scheme:Loose", "weberlink.control.ends:SlaveControl", carries_credit=False, does="nothing")
HALF = Scheme("toy_scheme:HalfMaster", "weberlink.control.ends:SlaveControl", carries_credit=False, does="half force")
"""
RUN = """
import json, sys
from pathlib import Path
from weberlink.session.advice import dry_run
from weberlink.config import ConfigurationError, load
from weberlink.session.simulation import build_simulation

simulation = build_simulation(load(Path(sys.argv[1]), ["control.scheme=half"]))
masters = [simulation.step()[0] for _ in range(2500)]
told = [(record.decoded_z, record.output_z) for record in masters if record.ramping == 0]
told = [entry for entry in told if 0.5 < abs(entry[0]) < 5.0]
errors = {}
for name in ("broken", "loose"):
    try:
        dry_run(load(Path(sys.argv[1]), [f"control.scheme={name}"]))
    except ConfigurationError as fault:
        errors[name] = str(fault)
ratios = sorted({round(output / decoded, 3) for decoded, output in told})
json.dump({"ratios": ratios, "errors": errors}, sys.stdout)
"""


def test_an_installed_scheme_renders_the_force_of_a_session_and_a_broken_one_is_refused(tmp_path: Path) -> None:
    folder = install(tmp_path, "toy-scheme", {"toy_scheme": TOY}, ENTRY_POINTS)
    ended = subprocess.run(
        [sys.executable, "-c", RUN, str(CONFIGURATION)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), *sys.path])},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    found = json.loads(ended.stdout)
    assert found["ratios"] == [0.5]
    assert found["errors"]["broken"].startswith(f"{CONFIGURATION}: control.scheme: control scheme broken")
    assert (
        "loose of toy-scheme: toy_scheme:Loose does not inherit from weberlink.control.ends.M"
        in found["errors"]["loose"]
    )
