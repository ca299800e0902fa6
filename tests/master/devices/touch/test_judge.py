"""Software of others judges the fake library and the constants: pyOpenHaptics, a wrapper that was written for libHD."""

import json
import os
import subprocess
import sys
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from time import monotonic
from typing import Any

import pytest

from tests.master.devices.touch.fake_hd import DEFAULT, library, plugged
from tests.wait import until
from weberlink.master.devices.touch import hdapi
from weberlink.master.devices.touch.device import TouchDevice
from weberlink.master.devices.touch.options import TouchOptions

THEIRS = find_spec("pyOpenHaptics")
CLIENT = "tests.master.devices.touch.client"
pytestmark = pytest.mark.skipif(THEIRS is None, reason="pyOpenHaptics is not installed")

SAME = {
    "BUTTONS": "HD_CURRENT_BUTTONS",
    "POSITION": "HD_CURRENT_POSITION",
    "TRANSFORM": "HD_CURRENT_TRANSFORM",
    "MAX_WORKSPACE": "HD_MAX_WORKSPACE_DIMENSIONS",
    "CALIBRATION_STYLE": "HD_CALIBRATION_STYLE",
    "MAX_FORCE": "HD_NOMINAL_MAX_FORCE",
    "FORCE": "HD_CURRENT_FORCE",
    "FORCE_OUTPUT": "HD_FORCE_OUTPUT",
    "FORCE_CLAMPING": "HD_MAX_FORCE_CLAMPING",
    "FORCE_LIMIT": "HD_SOFTWARE_FORCE_LIMIT",
    "CALIBRATED": "HD_CALIBRATION_OK",
    "CALIBRATION_NEEDS_UPDATE": "HD_CALIBRATION_NEEDS_UPDATE",
    "CALIBRATION_NEEDS_HAND": "HD_CALIBRATION_NEEDS_MANUAL_INPUT",
    "INKWELL_STYLE": "HD_CALIBRATION_INKWELL",
    "AUTO_STYLE": "HD_CALIBRATION_AUTO",
    "CONTINUE": "HD_CALLBACK_CONTINUE",
    "INVALID_HANDLE": "HD_INVALID_HANDLE",
}
DIFFERENT = {"HD_INVALID_OPERATION"}
"""0x0103 there; the maker's header as quoted in public has 0x0102."""
SPELT = {"HD_EXCEEDED_MAX_FORCE": "HD_EXCEED_MAX_FORCE"}
"""There without the end of the word."""


@pytest.fixture(scope="module")
def theirs() -> Any:
    """Its module of constants by its path: the package itself loads libHD.so at import."""
    assert THEIRS is not None
    assert THEIRS.submodule_search_locations is not None
    spec = spec_from_file_location("hd_define", Path(THEIRS.submodule_search_locations[0]) / "hd_define.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_constants_are_those_of_the_third_party(theirs: Any) -> None:
    constants = {name for name in vars(hdapi) if name.isupper() and isinstance(getattr(hdapi, name), int)}
    assert constants - set(SAME) == {"DEFAULT_PRIORITY"}
    for ours, name in SAME.items():
        assert getattr(hdapi, ours) == getattr(theirs, name), ours


def test_error_codes_are_those_of_the_third_party(theirs: Any) -> None:
    compared = 0
    for code, name in hdapi.ERRORS.items():
        other = getattr(theirs, SPELT.get(name, name), None)
        if other is not None and name not in DIFFERENT:
            assert other == code, name
            compared += 1
    assert compared >= 18


def started(name: str, force: list[float], seconds: float) -> "subprocess.Popen[str]":
    """The third party's program on the fake library."""
    return subprocess.Popen(
        [sys.executable, "-m", CLIENT, name, json.dumps(force), str(seconds)],
        cwd=Path(__file__).parents[4],
        env={**os.environ, "LD_LIBRARY_PATH": str(library().parent)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_third_party_reads_and_pushes_on_the_fake(tmp_path: Path) -> None:
    with plugged(tmp_path, "left") as (board,):
        board.centre[:], board.radius, board.buttons = (10.0, 20.0, 30.0), 0.0, 1
        board.rotation[:] = (0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
        out, said = started("left", [0.5, 0.0, 0.25], 0.3).communicate(timeout=60)
        assert "Error during the main scheduler" not in said
        seen = json.loads(out.splitlines()[-1])  # the library prints on the standard output too
        assert seen["frames"] > 50
        assert (seen["position"], seen["buttons"]) == ([10.0, 20.0, 30.0], 1)
        assert seen["x_axis"] == [0.0, 1.0, 0.0]
        assert seen["model"] == "Fake Touch"
        assert tuple(board.force) == (0.5, 0.0, 0.25)
        assert board.owner == 0


@pytest.mark.realtime
def test_force_that_a_killed_program_left_ends_at_opening(tmp_path: Path) -> None:
    """Why the library has a process of its own: a program that has it in itself leaves the force when it is killed."""
    with plugged(tmp_path) as (board,):
        program = started(DEFAULT, [2.0, 0.0, 0.0], 60.0)
        until(lambda: board.displayed > 1.99, "the board")
        program.kill()
        program.communicate()
        assert board.displayed == pytest.approx(2.0)
        device = TouchDevice(TouchOptions(library=str(library())), 0.001)
        device.open(monotonic())
        try:
            assert board.displayed == 0.0
        finally:
            device.close()
