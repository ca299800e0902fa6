"""The evaluate command where its work is shared: processes, a cluster, and what is left behind."""

import csv
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from typer.testing import CliRunner, Result

from tests.studies.evaluate.signals import walk, wall
from tests.system.clusters import Cluster, cluster
from tests.system.processes import until
from tests.system.systems import CONFIGS
from tests.system.work import reject, slowly
from weberlink.cli import app
from weberlink.studies.evaluate.command import run
from weberlink.studies.evaluate.study import Recording, Row, Study
from weberlink.studies.evaluate.table import FEW, table_of

OPERATOR = CONFIGS / "traces" / "operator.csv"
RECORDED = CONFIGS.parent.parent / "shared" / "traces"


def write(path: Path, ticks: int, seed: int) -> Path:
    made = walk(ticks, seed)
    lines = ["t,px,py,pz,fx,fy,fz"]
    columns = zip(made.time_s.tolist(), made.position_m.tolist(), made.force_n.tolist(), strict=True)
    lines += [",".join(map(repr, [time, *position, *force])) for time, position, force in columns]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines))
    return path


@pytest.fixture(scope="module")
def traces(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The longest last, so that what is done first is not what comes first."""
    folder = tmp_path_factory.mktemp("traces")
    return [write(folder / f"walk_{seed}.csv", 300 + 200 * seed, seed) for seed in range(3)]


MAIN = "from weberlink.cli import main; main()"


def command(*arguments: object, program: str = MAIN) -> list[str]:
    return [sys.executable, "-c", program, *map(str, ("evaluate", *arguments))]


def program(*arguments: object, before: str = "") -> subprocess.CompletedProcess[str]:
    """The command as a process that does something else before it."""
    line = command(*arguments, program=before + MAIN)
    return subprocess.run(line, cwd=CONFIGS.parent, capture_output=True, text=True, timeout=120, check=False)


def patience(seconds: float) -> str:
    """Less than the command has, for what is known to wait in vain."""
    return f"from evaluation import cluster; cluster.PATIENCE_S = {seconds}; "


def timeless(document: dict[str, Any]) -> str:
    """All but what is measured, to the last bit of every number."""
    del document["run_time_s"]
    for row in document["rows"]:
        del row["tick_us"]
    return json.dumps(document)


def rows_from(*arguments: object) -> str:
    ended = program(*arguments, "--json", "-")
    assert (ended.returncode, ended.stderr) == (0, "")
    return timeless(json.loads(ended.stdout))


def complaint(ended: subprocess.CompletedProcess[str] | Result, status: int) -> str:
    returned = ended.exit_code if isinstance(ended, Result) else ended.returncode
    assert (returned, ended.stdout) == (status, "")
    lines = ended.stderr.splitlines()
    assert len(lines) == 1, ended.stderr
    return lines[0]


def invoke(*arguments: object) -> Result:
    """The command in this process, where it makes no difference."""
    return CliRunner().invoke(app, list(map(str, ("evaluate", *arguments))))


# --- traces


def test_traces_of_one_stem_are_told_apart(tmp_path: Path) -> None:
    one, other = (write(tmp_path / folder / "run.csv", 200, seed) for seed, folder in enumerate(("a", "b")))
    result = run([one, other], "zoh", "0.1", 0.02)
    assert [row.trace for row in result.rows] == ["a/run", "b/run"]
    assert result.rows[0].packets != result.rows[1].packets


def test_the_same_trace_twice_is_one_line(tmp_path: Path) -> None:
    link = tmp_path / "link.csv"
    link.symlink_to(OPERATOR)
    for again in (OPERATOR, OPERATOR.parent / ".." / "traces" / OPERATOR.name, link):
        line = complaint(invoke(OPERATOR, again), 2)
        assert line == f"weberlink: {again}: listed twice, and would count twice in every mean"


def test_the_factors_of_the_paper_have_a_name() -> None:
    result = run([OPERATOR], "zoh", "paper", 0.02)
    assert [row.weber for row in result.rows] == [0.025, 0.05, 0.10, 0.15, 0.20, 0.30]


# --- processes


def test_rows_are_the_same_whatever_the_number_of_processes(traces: list[Path]) -> None:
    alone, shared = (rows_from(*traces, "--weber", "0.05,0.2", "--workers", workers) for workers in (1, 2))
    assert len(json.loads(alone)["rows"]) == 30
    assert shared == alone


def test_progress_is_told_task_by_task(traces: list[Path]) -> None:
    told: list[tuple[int, int]] = []
    run(traces, "zoh,plane", "0.1,0.2", 0.02, progress=lambda done, total: told.append((done, total)))
    assert told == [(done, 6) for done in range(1, 7)]


def test_a_process_that_dies_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("weberlink.studies.evaluate.command.rows_of", reject)
    assert complaint(invoke(OPERATOR, "--weber", "0.1,0.2", "--workers", 2), 1) == (
        "weberlink: a worker process died before the end, perhaps for lack of memory; try fewer of them with --workers"
    )


# --- what codes


@pytest.mark.skipif(find_spec("numba") is None, reason="numba (extra: compiled) is not installed")
def test_rows_are_the_same_whatever_codes(traces: list[Path]) -> None:
    rows = []
    for engine in ("python", "compiled"):
        document = run(traces, "zoh,hybrid", "0.05,0.2", 0.02, engine=engine).document
        assert document["engine"] == engine
        rows.append([{key: value for key, value in row.items() if key != "tick_us"} for row in document["rows"]])
    assert rows[0] == rows[1]


def test_little_work_is_done_by_the_live_codec() -> None:
    assert run([OPERATOR], "zoh", "0.1", 0.02).document["engine"] == "python"


def test_an_engine_that_there_is_not_is_one_line() -> None:
    line = complaint(invoke(OPERATOR, "--engine", "steam"), 2)
    assert line == "weberlink: --engine: 'steam' is none of auto, python, compiled"


def test_compiling_without_numba_is_one_line() -> None:
    hidden = "import sys; sys.modules['numba'] = None; import importlib.util as u; found = u.find_spec; "
    hidden += "u.find_spec = lambda name, *more: None if name == 'numba' else found(name, *more); "
    line = complaint(program(OPERATOR, "--engine", "compiled", before=hidden), 2)
    assert line == ('weberlink: --engine compiled: needs numba; install it with: pip install "weberlink[compiled]"')


# --- a cluster

pytest.importorskip("distributed", reason="needs distributed (extra: dask)")
from weberlink.studies.cluster import LostClusterError, spread_on_cluster  # noqa: E402 - of the extra


@pytest.fixture(scope="module")
def two_workers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with cluster(tmp_path_factory.mktemp("cluster"), workers=2) as started:
        yield started


def test_rows_of_a_cluster_are_those_of_this_machine(two_workers: Cluster, traces: list[Path]) -> None:
    arguments = (*traces, "--weber", "0.05,0.1,0.2")
    assert rows_from(*arguments, "--dask", two_workers.address) == rows_from(*arguments, "--workers", 1)


def test_both_workers_of_a_cluster_work(two_workers: Cluster) -> None:
    tasks = [((0.2, "shared"), number) for number in range(8)]
    answers = dict(spread_on_cluster(two_workers.address, slowly, tasks))
    assert {index: answer[1] for index, answer in answers.items()} == dict(enumerate(range(8)))
    assert {answer[0] for answer in answers.values()} == {worker.pid for worker in two_workers.workers}


def test_work_of_a_worker_that_dies_is_done_by_another_and_that_of_the_last_by_none(tmp_path: Path) -> None:
    tasks = [((0.2, "shared"), number) for number in range(8)]
    with cluster(tmp_path, workers=2) as started:
        answers = []
        for answer in spread_on_cluster(started.address, slowly, tasks):
            if not answers:
                started.workers[0].kill()
            answers.append(answer)
        assert sorted((index, number) for index, (_, number) in answers) == [(n, n) for n in range(8)]
        assert lost(started, started.workers[1]) == "no worker is left"


def lost(started: Cluster, dies: subprocess.Popen[bytes]) -> str:
    """What is said of a cluster when a process of it dies in the middle of the work."""
    working = spread_on_cluster(started.address, slowly, [((0.5, "shared"), number) for number in range(8)])
    next(working)
    dies.kill()
    with pytest.raises(LostClusterError) as caught:
        list(working)
    return str(caught.value).removeprefix(f"{started.address}: ").removesuffix("; the rest of the work is not done")


def test_a_cluster_without_workers_is_one_line(tmp_path: Path) -> None:
    with cluster(tmp_path, workers=0) as started:
        line = complaint(program(OPERATOR, "--dask", started.address, before=patience(2.0)), 2)
    address = started.address
    assert line == (
        f"weberlink: --dask: {address}: the scheduler has no workers; start some with: dask worker {address}"
    )


NOWHERE = ("tcp://127.0.0.1:1", "nonsense", "post://host:1", "tcp://host.invalid:8786")
EACH = """
import sys
from weberlink.cli import app
for address in sys.argv.pop().split():
    try:
        app([*sys.argv[1:], "--dask", address], prog_name="weberlink")
    except SystemExit as ended:
        assert ended.code == 2
"""
"""The command once for each of the addresses in the last argument."""


def test_an_address_where_nobody_answers_is_one_line() -> None:
    """A process, which says nothing more of half-made clients when it ends."""
    line = command(OPERATOR, " ".join(NOWHERE), program=patience(0.5) + EACH)
    ended = subprocess.run(line, cwd=CONFIGS.parent, capture_output=True, text=True, timeout=120, check=False)
    assert (ended.returncode, ended.stdout) == (0, "")
    lines = ended.stderr.splitlines()
    assert len(lines) == len(NOWHERE), ended.stderr
    for address, said in zip(NOWHERE, lines, strict=True):
        assert said.startswith(f"weberlink: --dask: {address}: no scheduler answers there (")
        assert said.endswith("); expected an address such as tcp://host:8786")


def test_processes_of_this_machine_are_none_of_a_cluster() -> None:
    line = complaint(invoke(OPERATOR, "--dask", "tcp://127.0.0.1:1", "--workers", 2), 2)
    assert line == "weberlink: --workers: is for this machine; with --dask it is the cluster that has workers"


def test_without_distributed_a_cluster_is_refused_in_one_line_and_nothing_else_needs_it() -> None:
    without = "import sys; sys.modules['distributed'] = None; from weberlink.cli import main; main()"
    ended = [
        subprocess.run(
            command(OPERATOR, "--predictor", "zoh", *more, program=without),
            cwd=CONFIGS.parent,
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        for more in (("--dask", "tcp://127.0.0.1:1"), ())
    ]
    assert complaint(ended[0], 2) == (
        'weberlink: --dask: needs distributed; install it with: pip install "weberlink[dask]"'
    )
    assert ended[1].returncode == 0


# --- ended by hand


NOTED = """
import sys
from pathlib import Path
import weberlink.studies.evaluate.command
run, first = weberlink.evaluate.run, Path(sys.argv.pop())
def noted(*arguments, progress, **options):
    def told(done, total):
        first.touch()
        progress(done, total)
    return run(*arguments, progress=told, **options)
weberlink.evaluate.run = noted
"""
"""Leaves a file when the first piece of the work is done; its name is the last argument."""


def interrupted(*arguments: object, first: Path) -> subprocess.CompletedProcess[str]:
    """Ctrl-C in the middle of the work: the signal reaches every process of the group."""
    process = subprocess.Popen(
        command(*arguments, first, program=NOTED + MAIN), cwd=CONFIGS.parent, text=True, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    until(lambda: first.exists() or process.poll() is not None, "the first piece of the work")
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=60)
    return subprocess.CompletedProcess(process.args, process.returncode, out, err)


MANY = ",".join(f"{0.0005 * step:g}" for step in range(1, 400))
"""Minutes of work."""


@pytest.mark.parametrize("workers", [1, 2])
def test_ctrl_c_ends_it_without_a_word(workers: int, tmp_path: Path) -> None:
    ended = interrupted(OPERATOR, "--weber", MANY, "--workers", workers, first=tmp_path / "first")
    assert (ended.returncode, ended.stdout, ended.stderr.strip()) == (130, "", "")


def test_ctrl_c_takes_its_work_from_the_cluster(two_workers: Cluster, traces: list[Path], tmp_path: Path) -> None:
    ended = interrupted(OPERATOR, "--weber", MANY, "--dask", two_workers.address, first=tmp_path / "first")
    assert (ended.returncode, ended.stdout, ended.stderr.strip()) == (130, "", "")
    # The cluster is free for others at once.
    assert json.loads(rows_from(traces[0], "--dask", two_workers.address))["rows"]


def test_a_scheduler_that_dies_is_one_line(two_workers: Cluster) -> None:
    """The last to use this cluster."""
    assert lost(two_workers, two_workers.scheduler) == "the scheduler went away"


# --- what is left behind


def printed(rows: list[Row]) -> list[str]:
    paper = StringIO()
    Console(width=80, file=paper).print(table_of(rows, 0.10, 1.0, "made by a test"))
    return paper.getvalue().splitlines()


def test_the_limit_is_shown_where_it_is_known() -> None:
    (row,) = Study(("zoh",)).rows(Recording("wall", wall(200)))
    unknown, known = (printed([replace(row, clairvoyant_packets=packets)]) for packets in (None, 3))
    assert unknown[0].split() == ["trace", "predictor", "k", "packets/s", "fewer", "RMS", "JND", "noticed", "us/tick"]
    assert known[0].split()[3:5] == ["packets/s", "limit"]
    assert known[1].split()[3:5] == [f"{row.packets_per_s:.1f}", "15.0"]


def test_few_rows_are_printed_one_by_one_and_many_as_means() -> None:
    study = Study(webers=tuple(0.02 * step for step in range(1, 6)))
    one = list(study.rows(Recording("a_name_that_is_rather_long_for_a_column_1", wall(60))))
    other = list(study.rows(Recording("another", walk(60, seed=2))))
    lines = printed(one)
    assert max(map(len, lines)) <= 80
    assert [line.split()[0] for line in lines[1:26]] == ["…_for_a_column_1"] * 25
    assert len(one + other) > FEW
    lines = printed(one + other)
    assert max(map(len, lines)) <= 80
    assert lines[0].split()[:2] == ["predictor", "k"]
    mean = (one[0].packets_per_s + other[0].packets_per_s) / 2.0
    assert lines[1].split()[:3] == ["zoh", "0.02", f"{mean:.1f}"]
    assert any("means over 2 traces" in line for line in lines)


def test_plots_are_curves_a_moment_a_surface_and_all_rows(traces: list[Path], tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    ended = invoke(*traces[:2], OPERATOR, "--weber", "0.1,0.2", "--plots", tmp_path, "--json", tmp_path / "rows.json")
    assert (ended.exit_code, ended.stderr) == (0, "")
    drawn = {path.name for path in tmp_path.iterdir()}
    for name in ("packet_rate", "quality", "quality_over_rate", "force", "model"):
        assert {f"{name}.png", f"{name}.svg"} <= drawn
    with (tmp_path / "rows.csv").open(newline="", encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    rows = json.loads((tmp_path / "rows.json").read_text())["rows"]
    assert len(table) == len(rows) == 30
    for flat, row in zip(table, rows, strict=True):
        selected = row.pop("selected", None)
        assert {key: flat[key] for key in row} == {key: str(value) for key, value in row.items()}
        assert [flat[f"selected_{name}"] for name in ("zoh", "linear", "plane", "sphere")] == (
            ["", "", "", ""] if selected is None else [str(sends) for sends in selected.values()]
        )
    assert (tmp_path / "curves.csv").read_text().count("\n") == 11


def test_one_trace_without_geometry_has_no_surface_to_draw(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    ended = invoke(OPERATOR, "--predictor", "zoh", "--plots", tmp_path)
    assert (ended.exit_code, ended.stderr) == (0, "")
    assert "quality.png" in {path.name for path in tmp_path.iterdir()}
    assert not list(tmp_path.glob("model*"))


@pytest.mark.skipif(not RECORDED.is_dir(), reason="recordings of people lie in ../shared/traces, which is not here")
def test_on_recordings_of_people_the_codec_keeps_its_word_and_none_beats_the_clairvoyant() -> None:
    for row in run(sorted(RECORDED.glob("tue_*_1.csv")), "zoh,linear,plane,hybrid", "0.1,0.2", 0.02).rows:
        assert row.violation_fraction == 0.0
        assert row.clairvoyant_packets is not None
        assert row.clairvoyant_packets <= row.packets
