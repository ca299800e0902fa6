"""Software of others judges calls and constants: forcedimension-core, and pyOpenHaptics, a wrapper of libHD.

Run as a program with FDSDK set, this file compares the library of Force Dimension.
"""

import os
import platform
import re
import subprocess
import sys
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from plugins.devices.tests.compiler import compiled
from plugins.devices.tests.force_dimension.fake import SOURCE
from tests.program import ROOT
from weberlink_devices.force_dimension import library
from weberlink_devices.force_dimension.options import MODELS
from weberlink_devices.touch import hdapi

BINDINGS, OPENHAPTICS = find_spec("forcedimension_core"), find_spec("pyOpenHaptics")
needs_bindings = pytest.mark.skipif(BINDINGS is None, reason="forcedimension-core is not installed")


def kind(type_: object) -> str:
    """The C type, where an array is the pointer that it becomes."""
    name = getattr(type_, "__name__", str(type_))
    return "LP_c_double" if name.startswith("c_double_Array") else name


def compare() -> int:
    """See that calls and constants are the same; gives the number of calls."""
    from forcedimension_core import constants, runtime  # noqa: PLC0415 - loads the library

    for name, (result, arguments) in library.PROTOTYPES.items():
        call = getattr(runtime._libdhd, name)
        assert kind(call.restype) == kind(result), name
        assert list(map(kind, call.argtypes)) == list(map(kind, arguments)), name
    index = constants.StatusIndex
    assert library.MOST_STATUS >= constants.MAX_STATUS
    ours = (library.RESET, library.FORCE, library.WRIST_DETECTED, library.WRIST_INIT, library.FORCE_OFF_CAUSE)
    assert ours == (index.RESET, index.FORCE, index.WRIST_DETECTED, index.WRIST_INIT, index.FORCEOFFCAUSE)
    cause = constants.ForceOffCause
    assert library.OFF_BY_WATCHDOG == cause.WATCHDOG
    assert set(library.OFF_CAUSES) == set(cause) - {cause.FORCES_NOT_OFF}
    types = {type_.name.lower(): int(type_) for type_ in constants.DeviceType}
    for name, model in MODELS.items():
        plain = name.removeprefix("novint_").replace(".", "")
        assert model.types == tuple(types[each] for each in (plain, f"{plain}_right", f"{plain}_left") if each in types)
    return len(library.PROTOTYPES)


@pytest.fixture(scope="module")
def sdk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder as the SDK's, with the stand-in; it has every call that the bindings name."""
    folder = tmp_path_factory.mktemp("sdk")
    place = folder / "lib" / "release" / f"lin-{platform.machine()}-gcc"
    place.mkdir(parents=True)
    assert BINDINGS is not None
    assert BINDINGS.origin is not None
    sources = "".join(path.read_text(encoding="utf-8") for path in Path(BINDINGS.origin).parent.rglob("*.py"))
    named = set(re.findall(r"_libd[hr]d\.(d[hr]d\w+)", sources))
    own = set(re.findall(r"\b(dhd\w+)\(", SOURCE.read_text(encoding="utf-8")))
    stubs = "".join(f"int {name}(void) {{ return -1; }}\n" for name in sorted(named - own))
    (folder / "all.c").write_text(f'#include "{SOURCE}"\n{stubs}')
    compiled(folder / "all.c", "libdrd.so.3.17", place)
    return folder


@needs_bindings
def test_calls_and_constants_of_the_driver_are_those_of_the_bindings(sdk: Path) -> None:
    command = [sys.executable, "-m", "plugins.devices.tests.test_judges"]
    environment = os.environ | {"FDSDK": str(sdk)}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("18\n", "")


@needs_bindings
def test_library_is_found_where_bindings_find_it(sdk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FDSDK", str(sdk))
    assert library.find().endswith("libdrd.so.3.17")


# --- libHD

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


@pytest.mark.skipif(OPENHAPTICS is None, reason="pyOpenHaptics is not installed")
def test_constants_and_error_codes_are_those_of_the_third_party() -> None:
    assert OPENHAPTICS is not None
    assert OPENHAPTICS.submodule_search_locations is not None
    # Its module of constants by its path: the package itself loads libHD.so at import.
    spec = spec_from_file_location("hd_define", Path(OPENHAPTICS.submodule_search_locations[0]) / "hd_define.py")
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


if __name__ == "__main__":
    print(compare())  # noqa: T201
