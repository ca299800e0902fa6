"""The evaluate command: arguments, processes, interruption, table and figures."""

import csv
import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from rich.console import Console
from typer.testing import CliRunner, Result

from tests.examples import examples
from tests.studies.evaluate.signals import walk, wall
from tests.system.systems import CONFIGS
from tests.wait import until
from weberlink.cli import app
from weberlink.codec.predictors import BANKS, PREDICTORS
from weberlink.studies.evaluate.command import run
from weberlink.studies.evaluate.study import EvaluationStudy
from weberlink.studies.evaluate.table import FEW, tables_of
from weberlink.studies.evaluate.traces import NamedTrace, names
from weberlink.studies.frame import Row, data_frame
from weberlink.system.configuration.model import PositionCodecSettings

OPERATOR = CONFIGS / "traces" / "operator.npz"
MAIN = "from weberlink.cli import main; main()"
MANY = ",".join(f"{0.0005 * step:g}" for step in range(1, 400))
"""Weber factors for minutes of work."""
SHARED = ("--predictor", "zoh,hybrid", "--weber", "0.05,0.2")
"""Work for several processes."""


def write(path: Path, ticks: int, seed: int) -> Path:
    made = walk(ticks, seed)
    lines = ["t,px,py,pz,fx,fy,fz"]
    columns = zip(made.time_s.tolist(), made.position_m.tolist(), made.force_n.tolist(), strict=True)
    lines += [",".join(map(repr, [time, *position, *force])) for time, position, force in columns]
    path.write_text("\n".join(lines))
    return path


@pytest.fixture(scope="module")
def traces(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The longest last, so that tasks are not done in the order of the rows."""
    folder = tmp_path_factory.mktemp("traces")
    return [write(folder / f"walk_{seed}.csv", 300 + 200 * seed, seed) for seed in range(3)]


def command(*arguments: object, program: str = MAIN) -> list[str]:
    return [sys.executable, "-c", program, *map(str, ("study", "evaluate", *arguments))]


def process(*arguments: object, program: str = MAIN) -> subprocess.CompletedProcess[str]:
    line = command(*arguments, program=program)
    return subprocess.run(line, cwd=CONFIGS.parent, capture_output=True, text=True, timeout=120, check=False)


def invoke(*arguments: object) -> Result:
    """The command in this process."""
    return CliRunner().invoke(app, list(map(str, ("study", "evaluate", *arguments))))


def rows_from(*arguments: object) -> list[dict[str, Any]]:
    """All rows without the measured run time, to the last bit of every number."""
    ended = process(*arguments, "--json", "-")
    assert (ended.returncode, ended.stderr) == (0, "")
    rows: list[dict[str, Any]] = json.loads(ended.stdout)["rows"]
    for row in rows:
        del row["tick_us"]
    return rows


@pytest.fixture(scope="module")
def alone(traces: list[Path]) -> list[dict[str, Any]]:
    """The rows of `SHARED`, from one process."""
    return rows_from(*traces, *SHARED, "--workers", 1)


def complaint(ended: subprocess.CompletedProcess[str] | Result, status: int) -> str:
    returned = ended.exit_code if isinstance(ended, Result) else ended.returncode
    assert (returned, ended.stdout) == (status, "")
    (line,) = ended.stderr.splitlines()
    return line


# --- traces and arguments


def test_a_trace_listed_twice_is_refused(tmp_path: Path) -> None:
    link = tmp_path / "link.csv"
    link.symlink_to(OPERATOR)
    for again in (OPERATOR, OPERATOR.parent / ".." / "traces" / OPERATOR.name, link):
        line = complaint(invoke(OPERATOR, again), 2)
        assert line == f"weberlink: {again}: listed twice, and would count twice in every mean"


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


def test_paper_stands_for_its_weber_factors(traces: list[Path]) -> None:
    assert [row["weber"] for row in run(traces[:1], "zoh", "paper", 0.02).rows] == [0.025, 0.05, 0.10, 0.15, 0.20, 0.30]


def test_every_predictor_of_a_configuration_can_be_evaluated(traces: list[Path]) -> None:
    rows = run(traces[:1], "all", "0.1", 0.02, position=True).rows
    named = {kind: [row["predictor"] for row in rows if row["channel"] == kind] for kind in ("force", "position")}
    assert named["force"] == [*PREDICTORS, *BANKS]
    for name in named["position"]:
        assert PositionCodecSettings.model_validate({"predictor": name}).predictor == name
    refused = set(named["force"]) - set(named["position"])
    for name in refused:
        with pytest.raises(ValidationError):
            PositionCodecSettings.model_validate({"predictor": name})


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--predictor", "cubic"), "--predictor: 'cubic' is none of zoh, "),
        (("--predictor", "zoh,zoh"), "--predictor: zoh is listed twice"),
        (("--weber", "often"), "--weber: must be numbers with commas between them, not 'often', or 'paper'"),
        (("--weber", "1.5"), "--weber: must be 0 to 1, not 1.5"),
        (("--deadband", "ball"), "--deadband: 'ball' is none of isotropic, "),
        (("--deadband", "level_crossing", "--floor", "0"), "--deadband level_crossing: needs --floor above 0"),
        (("--jnd", "0"), "--jnd: must be above 0 and at most 1, not 0"),
    ],
)
def test_a_wrong_argument_is_one_line(arguments: tuple[str, ...], said: str) -> None:
    assert complaint(invoke(OPERATOR, *arguments), 2).startswith(f"weberlink: {said}")


# --- processes


def in_units(path: Path, time: float, position: float, force: float = 1.0) -> Path:
    """A wall of 100 samples at 100 Hz, its numbers divided by what a unit is in SI."""
    rows = [(0.01 * i, 0.03, 0.0, -0.00002 * i, 0.0, 0.0, 0.01 * i) for i in range(100)]
    lines = [
        ",".join(f"{value / unit:.12g}" for value, unit in zip(row, (time, *[position] * 3, *[force] * 3), strict=True))
        for row in rows
    ]
    path.write_text("\n".join(("t,px,py,pz,fx,fy,fz", *lines)) + "\n")
    return path


@pytest.mark.parametrize(
    ("factors", "seen", "option"),
    [
        ((1e-3, 1e-3), "positions reach 30 m and samples are 10 s apart", "--units mm,ms, or --units m,s"),
        ((1.0, 1e-3), "positions reach 30 m", "--units mm, or --units m if"),
        ((1.0, 1e-6), "positions reach 3e+04 m", "--units um,"),
        ((1e-6, 1.0), "samples are 1e+04 s apart", "--units us,"),
        ((1.0, 1.0, 1e-4), "forces reach 9900 N", "--units mN, or --units N if"),
    ],
)
def test_unlikely_units_are_asked_about(factors: tuple[float, ...], seen: str, option: str, tmp_path: Path) -> None:
    path = in_units(tmp_path / "t.csv", *factors)
    result = CliRunner().invoke(app, ["study", "evaluate", str(path)])
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"weberlink: {path}: {seen}: in which units is it? Add ")
    assert option in line


def test_stated_units_give_the_figures_of_si_units(tmp_path: Path) -> None:
    si = run([in_units(tmp_path / "si.csv", 1.0, 1.0)], "zoh,plane", "0.1", 0.02).rows
    other = run([in_units(tmp_path / "mm.csv", 1e-3, 1e-3)], "zoh,plane", "0.1", 0.02, units="mm,ms").rows
    for a, b in zip(si, other, strict=True):
        assert b["packets_per_s"] == pytest.approx(a["packets_per_s"])
        assert b["error_rms_jnd"] == pytest.approx(a["error_rms_jnd"])
    stated = run([in_units(tmp_path / "far.csv", 1.0, 1e-3)], "zoh", "0.1", 0.02, units="m").rows
    assert len(stated) == 1, "if somebody says that it is so"


@pytest.mark.parametrize(
    ("units", "said"),
    [("mm,inch", "--units: 'inch' is none of s, ms, us, ns, m, cm,"), ("mm,m", "mm and m are both units of position")],
)
def test_wrong_units_are_one_line(units: str, said: str, tmp_path: Path) -> None:
    path = in_units(tmp_path / "t.csv", 1.0, 1.0)
    result = CliRunner().invoke(app, ["study", "evaluate", str(path), "--units", units])
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert said in result.stderr


def test_rows_do_not_depend_on_the_number_of_processes(traces: list[Path], alone: list[dict[str, Any]]) -> None:
    assert len(alone) == 12
    assert rows_from(*traces, *SHARED, "--workers", 2) == alone


def test_progress_is_reported_after_every_case(traces: list[Path]) -> None:
    told: list[tuple[int, int]] = []
    run(traces, "zoh", "0.1,0.2", 0.02, progress=lambda done, total: told.append((done, total)))
    assert told == [(done, 6) for done in range(1, 7)]


# --- interruption


def interrupted(
    *arguments: object, folder: Path, number: signal.Signals = signal.SIGINT
) -> subprocess.CompletedProcess[str]:
    """A signal in the middle of the work, which reaches every process of the group, as Ctrl-C and systemd's SIGTERM."""
    first = folder / "first"
    touching = f"""
from pathlib import Path
import weberlink.studies.evaluate.command as command
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


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("workers", [1, 2])
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


# --- table and figures


def printed(rows: list[Row]) -> list[str]:
    paper = StringIO()
    Console(width=80, file=paper).print(tables_of(data_frame(rows), 0.10, 1.0, "made by a test"))
    return paper.getvalue().splitlines()


def test_few_rows_are_printed_singly_and_many_as_means() -> None:
    study = EvaluationStudy(webers=tuple(0.02 * step for step in range(1, 6)))
    one = study.rows(NamedTrace("a_name_that_is_rather_long_for_a_column_1", wall(60)))
    other = study.rows(NamedTrace("another", walk(60, seed=2)))
    lines = printed(one)
    assert max(map(len, lines)) <= 80
    assert [line.split()[0] for line in lines[1:26]] == ["…for_a_column_1"] * 25
    assert len(one + other) > FEW
    lines = printed(one + other)
    assert max(map(len, lines)) <= 80
    assert lines[0].split()[:4] == ["source", "predictor", "k", "n"]
    mean = (one[0]["packets_per_s"] * other[0]["packets_per_s"]) ** 0.5
    assert lines[1].split()[:5] == ["files", "zoh", "0.02", "2", f"{mean:.1f}"]


def test_plots_write_all_figures_and_rows(traces: list[Path], tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    arguments = ("--predictor", "zoh,hybrid", "--weber", "0.1,0.2", "--plots", tmp_path, "--csv", tmp_path / "rows.csv")
    ended = invoke(traces[0], OPERATOR, *arguments, "--json", tmp_path / "rows.json")
    assert (ended.exit_code, ended.stderr) == (0, "")
    drawn = {path.name for path in tmp_path.iterdir()}
    assert "error_over_cost.png" in drawn
    for name in ("packet_rate", "quality", "quality_over_rate", "force"):
        assert {f"{name}.png", f"{name}.svg"} <= drawn
    with (tmp_path / "rows.csv").open(newline="", encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    rows = json.loads((tmp_path / "rows.json").read_text())["rows"]
    assert len(table) == len(rows) == 8
    for flat, row in zip(table, rows, strict=True):
        selected = row.pop("selected", None)
        assert {key: flat[key] for key in row} == {key: str(value) for key, value in row.items()}
        assert [flat[f"selected_{name}"] for name in ("zoh", "linear", "plane", "sphere")] == (
            ["", "", "", ""] if selected is None else [str(float(sends)) for sends in selected.values()]
        )
    assert (tmp_path / "curves.csv").read_text().count("\n") == 5


def drawn(folder: Path, *options: object) -> Result:
    return invoke(OPERATOR, "--predictor", "zoh,linear,plane,hybrid", "--plots", folder, *options)


def test_every_predictor_is_in_the_figure_over_time(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    ended = drawn(tmp_path, "--from", 1.0, "--to", 1.2, "--format", "svg", "--no-footer")
    assert (ended.exit_code, ended.stderr) == (0, "")
    with (tmp_path / "force.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert list(dict.fromkeys(row["predictor"] for row in rows)) == ["zoh", "linear", "plane", "hybrid"]
    times = [float(row["t_s"]) for row in rows]
    assert (min(times), max(times)) == pytest.approx((1.0, 1.2), abs=2e-3)
    svg = (tmp_path / "force.svg").read_text(encoding="utf-8")
    for name in ("zoh", "linear", "plane", "hybrid"):
        assert f">{name}: " in svg
    metadata, _, body = svg.partition("</metadata>")
    assert "numpy" in metadata
    assert "numpy" not in body
    assert not list(tmp_path.glob("*.png"))


def test_wrong_figure_options_are_said_before_the_work(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    for options, said in (
        (("--format", "jpg"), "--format: 'jpg' is none of png, pdf, svg"),
        (("--from", 3600.0), "--from, --to: operator has no two samples there; its time is 0 to"),
    ):
        ended = drawn(tmp_path / "none", *options)
        assert (ended.exit_code, ended.stdout) == (2, "")
        assert said in ended.stderr
    assert not (tmp_path / "none").exists()


def test_recordings_of_people_stay_within_the_deadband() -> None:
    for row in run([Path(f"tue_{what}_1") for what in ("rigid", "foam", "free")], "zoh,hybrid", "0.1", 0.02).rows:
        assert row["source"] == "tue"
        assert row["violation_fraction"] == 0.0
