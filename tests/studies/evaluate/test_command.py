"""The evaluate command: arguments, processes, interruption, table and figures."""

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from tests.system.systems import CONFIGS
from tests.wait import until
from weberlink.studies.evaluate.command import run
from weberlink.studies.evaluate.traces import names

OPERATOR = CONFIGS / "traces" / "operator.npz"
MANY = ",".join(f"{0.0005 * step:g}" for step in range(1, 400))
"""Weber factors for minutes of work."""


@pytest.mark.parametrize(
    ("listed", "expected"),
    [
        (["/x/run.csv", "/y/run.csv", "/y/other.csv"], ["x/run", "y/run", "other"]),
        (["/x/run.csv", "/x/run.mcap", "/y/run.csv"], ["x/run.csv", "x/run.mcap", "y/run.csv"]),
        (["/x/run.csv", "/x/run.mcap", "/x/run.csv.csv"], ["/x/run.csv", "/x/run.mcap", "/x/run.csv.csv"]),
    ],
)
def test_a_name_is_as_long_as_needed(listed: list[str], expected: list[str]) -> None:
    assert names([Path(each) for each in listed]) == expected


def in_units(path: Path, time: float, position: float, force: float = 1.0) -> Path:
    """A wall of 100 samples at 100 Hz, its numbers divided by what a unit is in SI."""
    rows = [(0.01 * i, 0.03, 0.0, -0.00002 * i, 0.0, 0.0, 0.01 * i) for i in range(100)]
    lines = [
        ",".join(f"{value / unit:.12g}" for value, unit in zip(row, (time, *[position] * 3, *[force] * 3), strict=True))
        for row in rows
    ]
    path.write_text("\n".join(("t,px,py,pz,fx,fy,fz", *lines)) + "\n")
    return path


def test_stated_units_give_the_figures_of_si_units(tmp_path: Path) -> None:
    si = run([in_units(tmp_path / "si.csv", 1.0, 1.0)], "zoh,plane", "0.1", 0.02).rows
    other = run([in_units(tmp_path / "mm.csv", 1e-3, 1e-3)], "zoh,plane", "0.1", 0.02, units="mm,ms").rows
    for a, b in zip(si, other, strict=True):
        assert b["packets_per_s"] == pytest.approx(a["packets_per_s"])
        assert b["error_rms_jnd"] == pytest.approx(a["error_rms_jnd"])


def interrupted(*arguments: object, folder: Path) -> subprocess.CompletedProcess[str]:
    """SIGINT in the middle of the work, which reaches every process of the group, as Ctrl-C does."""
    first = folder / "first"
    touching = f"""
from pathlib import Path
import weberlink.studies.evaluate.command as command
run = command.run
def noted(*arguments, progress, **options):
    return run(*arguments, progress=lambda *state: Path({str(first)!r}).touch(), **options)
command.run = noted
from weberlink.cli import main; main()
"""
    program = subprocess.Popen(
        [sys.executable, "-c", touching, "study", "evaluate", *map(str, arguments)], cwd=CONFIGS.parent, text=True,
        start_new_session=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        until(lambda: first.exists() or program.poll() is not None, "the first task")
        os.killpg(program.pid, signal.SIGINT)
        out, err = program.communicate(timeout=60)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(program.pid, signal.SIGKILL)
    return subprocess.CompletedProcess(program.args, program.returncode, out, err)


def test_ctrl_c_keeps_finished_rows(tmp_path: Path) -> None:
    ended = interrupted(OPERATOR, "--weber", MANY, "--workers", 2, "--json", "-", folder=tmp_path)
    document, many = json.loads(ended.stdout), 5 * len(MANY.split(","))
    assert (ended.returncode, document["interrupted"], 0 < len(document["rows"]) < many) == (130, True, True)
    # Nothing of the processes and of what they share is left, of which the standard library would complain.
    *notes, last = ended.stderr.splitlines()
    assert last == f"weberlink: interrupted: {len(document['rows'])} of {many} cases are done, and in the JSON above"
    assert all(", after " in line for line in notes)
