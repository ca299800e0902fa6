"""The scripts of the page: their own tests, the types of messages, and the published libraries beside them."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from plugins.page.tests import declarations
from tests.program import ROOT

HERE = Path(__file__).parent / "page"
MODULES = ROOT / "build" / "page" / "node_modules"
NODE = shutil.which("node")


@pytest.mark.skipif(NODE is None, reason="needs node: apt-get install nodejs")
def test_scripts_pass_their_own_tests() -> None:
    run = subprocess.run([NODE or "", "--test", HERE], capture_output=True, text=True, check=False, cwd=ROOT)
    assert run.returncode == 0, run.stdout
    assert re.search(r"^. pass [1-9]", run.stdout, re.MULTILINE), run.stdout


def test_declarations_are_those_of_the_messages() -> None:
    expected = declarations.declarations()
    assert declarations.PATH.read_text(encoding="utf-8") == expected, "run python -m plugins.page.tests.declarations"
