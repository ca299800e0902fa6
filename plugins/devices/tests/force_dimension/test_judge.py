"""Bindings that others wrote (forcedimension-core) agree with the driver."""

import os
import platform
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from plugins.devices.tests.compiler import compiled
from plugins.devices.tests.force_dimension.fake import SOURCE
from tests.program import ROOT
from weberlink_devices.force_dimension.library import find

BINDINGS = find_spec("forcedimension_core")
pytestmark = pytest.mark.skipif(BINDINGS is None, reason="forcedimension-core is not installed")


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


def test_calls_and_constants_of_the_driver_are_those_of_the_bindings(sdk: Path) -> None:
    command = [sys.executable, "-m", f"{__package__}.judge"]  # which loads the library on import
    environment = os.environ | {"FDSDK": str(sdk)}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("18\n", "")


def test_library_is_found_where_bindings_find_it(sdk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FDSDK", str(sdk))
    assert find().endswith("libdrd.so.3.17")
