"""The scripts of the page: their own tests, the types of messages, and the published libraries beside them."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

import weberlink.apps.monitor
from tests.apps.monitor import declarations
from tests.program import ROOT
from weberlink.system.bounded_json import parse

HERE = Path(__file__).parent / "page"
VENDOR = Path(weberlink.apps.monitor.__file__).parent / "page" / "vendor"
MODULES = ROOT / "build" / "page" / "node_modules"
NODE = shutil.which("node")


@pytest.mark.skipif(NODE is None, reason="needs node: apt-get install nodejs")
def test_scripts_pass_their_own_tests() -> None:
    run = subprocess.run([NODE or "", "--test", HERE], capture_output=True, text=True, check=False, cwd=ROOT)
    assert run.returncode == 0, run.stdout
    assert re.search(r"^. pass [1-9]", run.stdout, re.MULTILINE), run.stdout


def test_declarations_are_those_of_the_messages() -> None:
    expected = declarations.declarations()
    assert declarations.PATH.read_text(encoding="utf-8") == expected, "run python -m tests.apps.monitor.declarations"


def test_libraries_beside_the_page_are_of_the_pinned_versions() -> None:
    package = parse((HERE / "package.json").read_bytes(), 4096)["devDependencies"]
    assert f"(v{package['uplot']})" in (VENDOR / "uplot.js").read_text(encoding="utf-8")[:500]
    revision = package["three"].split(".")[1]
    assert f'"{revision}"' in (VENDOR / "three.core.min.js").read_text(encoding="utf-8")[:2000]
    for name in ("uplot", "three"):
        assert (VENDOR / f"{name}.LICENSE").is_file()
