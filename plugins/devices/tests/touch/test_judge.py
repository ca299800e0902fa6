"""Software of others judges the constants: pyOpenHaptics, a wrapper that was written for libHD."""

from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from weberlink_devices.touch import hdapi

THEIRS = find_spec("pyOpenHaptics")

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


@pytest.mark.skipif(THEIRS is None, reason="pyOpenHaptics is not installed")
def test_constants_and_error_codes_are_those_of_the_third_party() -> None:
    assert THEIRS is not None
    assert THEIRS.submodule_search_locations is not None
    # Its module of constants by its path: the package itself loads libHD.so at import.
    spec = spec_from_file_location("hd_define", Path(THEIRS.submodule_search_locations[0]) / "hd_define.py")
    assert spec is not None
    assert spec.loader is not None
    theirs = module_from_spec(spec)
    spec.loader.exec_module(theirs)
    constants = {name for name in vars(hdapi) if name.isupper() and isinstance(getattr(hdapi, name), int)}
    assert constants - set(SAME) == {"DEFAULT_PRIORITY"}
    for ours, name in SAME.items():
        assert getattr(hdapi, ours) == getattr(theirs, name), ours
    compared = 0
    for code, name in hdapi.ERRORS.items():
        other = getattr(theirs, SPELT.get(name, name), None)
        if other is not None and name not in DIFFERENT:
            assert other == code, name
            compared += 1
    assert compared >= 18
