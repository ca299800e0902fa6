"""A command imports what it needs, when it needs it: imports take most of the time to its first line or its daemons."""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
HELP = """
import contextlib, io, json, sys
from weberlink.cli import main
with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()) as said:
    sys.argv[1:] = ["--help"]
    main()
assert "loopback" in said.getvalue()
json.dump(sorted(sys.modules), sys.stdout)
"""
# Takes the place of every process that the launcher starts, and ends the launcher in place of the first.
UNTIL_THE_DAEMONS = """
import json, os, subprocess, sys
def popen(line, **_):
    assert "weberlink.system.daemon" in line, line
    json.dump(sorted(sys.modules), sys.stdout)
    sys.stdout.flush()
    os._exit(0)
subprocess.Popen = popen
from weberlink.cli import main
sys.argv[1:] = ["loopback"]
main()
"""
SLOW = {"numpy", "scipy", "matplotlib", "uvloop", "asyncio", "rich", "aiohttp", "mcap"}
"""Packages that take long to import."""


def imported(script: str) -> set[str]:
    """Modules of a process at the end of a script."""
    # FORCE_COLOR: a status line would be shown.
    ended = subprocess.run(
        [sys.executable, "-c", script],
        cwd=ROOT,
        env={**os.environ, "FORCE_COLOR": "1"},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (ended.returncode, ended.stderr) == (0, "")
    return set(json.loads(ended.stdout))


def test_the_help_imports_neither_the_configuration_nor_what_displays_results() -> None:
    there = imported(HELP)
    assert not there & (SLOW | {"pydantic", "yaml", "weberlink.system.configuration", "weberlink.protocol"})
    assert not [name for name in there if name.startswith(("weberlink.studies", "weberlink.apps"))]


def test_a_launcher_imports_what_reads_records_after_its_daemons_are_started() -> None:
    there = imported(UNTIL_THE_DAEMONS)
    assert {"weberlink.system.launcher", "weberlink.system.configuration"} <= there
    assert not there & SLOW
    late = {
        "weberlink.telemetry.reader",
        "weberlink.system.scoring",
        "weberlink.system.report",
        "weberlink.system.daemon",
    }
    assert not there & (late | {"weberlink.system.recorder", "weberlink.system.journal"})
