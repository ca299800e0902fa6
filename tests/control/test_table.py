"""The table of schemes: what each line builds, and what it imports."""

import json
import subprocess
import sys
from typing import get_args

import pytest

from weberlink.control.choice import MMT, NONE, TDPA
from weberlink.control.contract import Settings
from weberlink.control.table import SCHEMES, build_master_control, build_slave_control
from weberlink.system.configuration.model import ControlSettings

SETTINGS = Settings(tick_period=1e-3, force_range=30.0, level=0.05, damping=5.0, catch_up_speed=0.25)
PORTS = {"drag", "force_port", "motion_port", "prediction", "tank", "tdpa"}
MODEL = {"drag", "force_port", "mmt", "model", "tank"}
PARTS = {
    "none": {"master": {"direct"}, "slave": {"direct"}},
    "tdpa": {"master": PORTS, "slave": PORTS},
    "mmt": {"master": MODEL, "slave": {"direct"}},
    "auto": {side: PORTS | MODEL | {"auto", "choice", "direct"} for side in ("master", "slave")},
}
BUILD = """
import json, sys
from weberlink.control.contract import Settings
from weberlink.control.table import build_{side}_control
build_{side}_control("{name}", Settings(1e-3, 30.0, 0.05, 5.0, 0.25))
json.dump([module.partition(".")[2] for module in sys.modules if module.startswith("control.")], sys.stdout)
"""


def test_the_configuration_offers_the_schemes_of_the_table() -> None:
    assert get_args(ControlSettings.model_fields["scheme"].annotation) == tuple(SCHEMES)


def test_what_is_active_is_a_place_in_the_table() -> None:
    assert [list(SCHEMES)[place] for place in (NONE, TDPA, MMT)] == ["none", "tdpa", "mmt"]


@pytest.mark.parametrize("name", SCHEMES)
def test_every_scheme_builds_and_starts_with_nothing_handed_over(name: str) -> None:
    for control in (build_master_control(name, SETTINGS), build_slave_control(name, SETTINGS)):
        assert (control.credit, control.tank) == (0, 0.0)


@pytest.mark.parametrize("side", ["master", "slave"])
@pytest.mark.parametrize("name", SCHEMES)
def test_only_what_a_scheme_needs_is_imported(name: str, side: str) -> None:
    ended = subprocess.run(
        [sys.executable, "-c", BUILD.format(side=side, name=name)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (ended.returncode, ended.stderr) == (0, "")
    assert set(json.loads(ended.stdout)) == PARTS[name][side] | {"contract", "table"}


def test_every_scheme_has_its_parts_listed() -> None:
    assert set(PARTS) == set(SCHEMES)
