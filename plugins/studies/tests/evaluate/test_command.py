"""The evaluate command: arguments, processes, interruption, table and figures."""

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from tests.examples import examples
from tests.system.systems import CONFIGS
from tests.wait import until
from weberlink.codec.predictors import BANKS, PREDICTORS
from weberlink.system.configuration.model import PositionCodecSettings
from weberlink_studies.evaluate.command import run
from weberlink_studies.evaluate.traces import names

OPERATOR = CONFIGS / "traces" / "operator.npz"
MAIN = "from weberlink.cli import main; main()"
MANY = ",".join(f"{0.0005 * step:g}" for step in range(1, 400))
"""Weber factors for minutes of work."""


def command(*arguments: object, program: str = MAIN) -> list[str]:
    return [sys.executable, "-c", program, *map(str, ("study", "evaluate", *arguments))]


@pytest.mark.parametrize(
    ("listed", "expected"),
    [
        (["/x/one.csv", "/y/two.csv"], ["one", "two"]),
        (["/x/run.csv", "/y/run.csv", "/y/other.csv"], ["x/run", "y/run", "other"]),
        (["/x/run.csv", "/x/run.mcap"], ["run.csv", "run.mcap"]),
        (["/x/k/run.csv", "/y/k/run.csv"], ["x/k/run", "y/k/run"]),
        (["/x/run.csv", "/x/run.mcap", "/y/run.csv"], ["x/run.csv", "x/run.mcap", "y/run.csv"]),
        (["/x/run.csv", "/x/run.mcap", "/x/run.csv.csv"], ["/x/run.csv", "/x/run.mcap", "/x/run.csv.csv"]),
    ],
)
def test_a_name_is_as_long_as_needed(listed: list[str], expected: list[str]) -> None:
    assert names([Path(each) for each in listed]) == expected


parts = st.sampled_from(["a", "b", "run", "run.csv"])
paths = st.builds(
    lambda folders, stem, end: Path("/", *folders, stem + end),
    st.lists(parts, max_size=3), parts, st.sampled_from([".csv", ".mcap", ""]),
)  # fmt: skip


@examples(50)
@given(st.lists(paths, unique_by=str, max_size=6))
def test_different_files_have_different_names(listed: list[Path]) -> None:
    assert len(set(names(listed))) == len(listed)


def test_every_predictor_of_a_configuration_can_be_evaluated(tmp_path: Path) -> None:
    rows = run([in_units(tmp_path / "t.csv", 1.0, 1.0)], "all", "0.1", 0.02, position=True).rows
    named = {kind: [row["predictor"] for row in rows if row["channel"] == kind] for kind in ("force", "position")}
    assert named["force"] == [*PREDICTORS, *BANKS]
    for name in named["position"]:
        assert PositionCodecSettings.model_validate({"predictor": name}).predictor == name
    refused = set(named["force"]) - set(named["position"])
    for name in refused:
        with pytest.raises(ValidationError):
            PositionCodecSettings.model_validate({"predictor": name})


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
    stated = run([in_units(tmp_path / "far.csv", 1.0, 1e-3)], "zoh", "0.1", 0.02, units="m").rows
    assert len(stated) == 1, "if somebody says that it is so"


def interrupted(
    *arguments: object, folder: Path, number: signal.Signals = signal.SIGINT
) -> subprocess.CompletedProcess[str]:
    """A signal in the middle of the work, which reaches every process of the group, as Ctrl-C and systemd's SIGTERM."""
    first = folder / "first"
    touching = f"""
from pathlib import Path
import weberlink_studies.evaluate.command as command
run = command.run
def noted(*arguments, progress, **options):
    return run(*arguments, progress=lambda *state: Path({str(first)!r}).touch(), **options)
command.run = noted
{MAIN}
"""
    program = subprocess.Popen(
        command(*arguments, program=touching), cwd=CONFIGS.parent, text=True, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        until(lambda: first.exists() or program.poll() is not None, "the first task")
        os.killpg(program.pid, number)
        out, err = program.communicate(timeout=60)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(program.pid, signal.SIGKILL)
    return subprocess.CompletedProcess(program.args, program.returncode, out, err)


@pytest.mark.parametrize(("workers", "number"), [(2, signal.SIGINT), (1, signal.SIGTERM)])
def test_ctrl_c_and_sigterm_keep_finished_rows(workers: int, number: signal.Signals, tmp_path: Path) -> None:
    ended = interrupted(OPERATOR, "--weber", MANY, "--workers", workers, "--json", "-", folder=tmp_path, number=number)
    document = json.loads(ended.stdout)
    assert (ended.returncode, document["interrupted"]) == (130, True)
    assert 0 < len(document["rows"]) < 5 * len(MANY.split(","))
    done = len(document["rows"])
    # Nothing of the processes and of what they share is left, of which the standard library would complain.
    assert ended.stderr.splitlines()[-1:] == [
        f"weberlink: interrupted: {done} of {5 * len(MANY.split(','))} cases are done, and in the JSON above"
    ]
    assert all(", after " in line for line in ended.stderr.splitlines()[:-1])


def test_recordings_of_people_stay_within_the_deadband() -> None:
    for row in run([Path(f"tue_{what}_1") for what in ("rigid", "foam", "free")], "zoh,hybrid", "0.1", 0.02).rows:
        assert row["source"] == "tue"
        assert row["violation_fraction"] == 0.0
