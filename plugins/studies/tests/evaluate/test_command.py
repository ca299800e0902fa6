"""The evaluate command: arguments, processes, interruption, table and figures."""

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from tests.program import document, weberlink
from tests.session.systems import CONFIGS
from tests.wait import PATIENCE, until
from weberlink_studies.evaluate.command import run
from weberlink_studies.evaluate.traces import names


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


MANY = ",".join(f"{0.0005 * step:g}" for step in range(1, 400))
"""Weber factors for minutes of work."""
WORK = """
import sys
from pathlib import Path
import weberlink_studies.evaluate.command as command
from weberlink.cli import main
run = command.run
command.run = lambda *given, progress, **options: run(*given, progress=lambda *_: Path(sys.argv[1]).touch(), **options)
main(sys.argv[2:])
"""


@pytest.mark.parametrize(("workers", "number"), [(2, signal.SIGINT), (1, signal.SIGTERM)])
def test_ctrl_c_and_sigterm_keep_finished_rows(workers: int, number: signal.Signals, tmp_path: Path) -> None:
    """The signal reaches every process of the group, as from a terminal or from systemd."""
    first = tmp_path / "first"
    options = ("--weber", MANY, "--workers", str(workers), "--json", "-")
    command = [sys.executable, "-c", WORK, first, "study", "evaluate", CONFIGS / "traces" / "operator.npz", *options]
    program = subprocess.Popen(
        command, cwd=CONFIGS.parent, text=True, start_new_session=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    try:
        until(lambda: first.exists() or program.poll() is not None, "the first task")
        os.killpg(program.pid, number)
        output, errors = program.communicate(timeout=PATIENCE)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(program.pid, signal.SIGKILL)
    report = json.loads(output)
    assert (program.returncode, report["interrupted"]) == (130, True)
    assert 0 < len(report["rows"]) < 5 * len(MANY.split(","))
    assert errors.splitlines()[-1].startswith("weberlink: interrupted")
    assert all(", after " in line for line in errors.splitlines()[:-1]), "nothing of the processes complains"


EVALUATE = ("study", "evaluate", "--predictor", "zoh", "--workers", "1")
HEADER = "t,px,py,pz,fx,fy,fz"
AT_0, AT_1, AT_2 = "0.000,0,0,0,0,0,0", "0.001,0,0,0,0,0,1", "0.002,0,0,0,0,0,1"


@pytest.mark.parametrize(
    ("suffix", "content", "field"),
    [
        ("csv", "\n".join([HEADER, AT_0, AT_2, AT_1]).encode(), "row 4, column t"),
        ("csv", "\n".join([HEADER, AT_0, AT_1, "0.002,0,0,0,nan,0,1"]).encode(), "row 4, column fx"),
        ("csv", HEADER.encode(), "rows"),
        ("mcap", b"", ""),
        ("mcap", b"\x89MCAP0\r\n", ""),
        ("mcap", b"\x89PNG\r\n\x1a\n" + bytes(100), ""),
    ],
)
def test_a_file_that_is_no_trace_is_one_line_that_names_it(
    suffix: str, content: bytes, field: str, tmp_path: Path
) -> None:
    file = tmp_path / f"odd.{suffix}"
    file.write_bytes(content)
    said = weberlink(*EVALUATE, file).complaint()
    assert said.startswith(f"weberlink: {file}: ") and field in said


def test_a_simulated_trace_can_be_evaluated_and_figures_are_not_lost(tmp_path: Path) -> None:
    path = tmp_path / "trace.csv"
    assert weberlink("simulate", CONFIGS / "scene-sphere.yaml", "--duration", 1, "--trace", path).status == 0
    (row,) = document(weberlink(*EVALUATE, "--json", "-", path).output)["rows"]
    assert row["packets"] > 0
    assert "--plots" in weberlink(*EVALUATE, path, "--plots", "-").errors
    full = weberlink(*EVALUATE, path, "--json", "/dev/full")  # which can be opened
    text, _, said = full.errors.rstrip("\n").rpartition("\n")
    assert (full.status, json.loads(text)["rows"][0]["packets"]) == (1, row["packets"])
    assert said.startswith("weberlink: /dev/full: cannot be written: ")
