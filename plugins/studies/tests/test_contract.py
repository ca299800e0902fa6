"""The contract of every study: its rows wherever they run, the files that its options name, and wrong arguments."""

import csv
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

pytest.importorskip("scipy")
pytest.importorskip("matplotlib")

from plugins.studies.tests.evaluate.signals import walk
from plugins.studies.tests.experiment.studies import Robot, conduct, plan
from plugins.studies.tests.precision.test_study import WALL
from tests.program import weberlink
from tests.session.systems import CONFIGS
from weberlink.slave.integrators import INTEGRATORS
from weberlink_studies.drawing import Drawing, drawn_as
from weberlink_studies.evaluate.command import STUDY as EVALUATE, EvaluationOptions
from weberlink_studies.evaluate.study import EvaluationStudy
from weberlink_studies.evaluate.traces import NamedTrace, read_traces
from weberlink_studies.experiment import ratings
from weberlink_studies.experiment.ledger import path_of
from weberlink_studies.frame import FrameResult
from weberlink_studies.paper.command import PAPER, SCENES, PaperOptions
from weberlink_studies.precision.study import STUDY as PRECISION, Effort
from weberlink_studies.sheet import save, sheet
from weberlink_studies.stability import display
from weberlink_studies.stability.cells import EXTREMES, SystemCell
from weberlink_studies.stability.display import STUDY as DISPLAY, DisplayCell, DisplayOptions
from weberlink_studies.stability.study import STUDY as MAP, MapOptions
from weberlink_studies.stability.wall import SampledWall

OPERATOR = CONFIGS / "traces" / "operator.npz"
LOOPBACK = CONFIGS / "loopback.yaml"
CURVES = {f"{name}.{ending}" for name in ("packet_rate", "quality", "quality_over_rate") for ending in ("png", "svg")}
MAPPED = [
    SampledWall(0.1, 5.0, 0.01, 1e-3),
    SampledWall(0.001, 5.0, 0.01, 1e-3, delay_ticks=1),
    SystemCell("plane", "none", round_trip_s=0.02, stiffness_n_m=1000.0),
    SystemCell("plane", "baseline-tdpa", stiffness_n_m=1e10),
    SystemCell("extremes", case="10 Hz", **EXTREMES["10 Hz"]),
]
DISPLAYED = [(DisplayCell("plane", 0), scheme) for scheme in ("none", "nothing")]


def rated(folder: Path) -> FrameResult:
    """Of a subject and of a program, and one who left."""
    for number, simulated, leave_at in ((1, False, 99), (2, False, 99), (3, False, 8), (1, True, 99)):
        path = path_of(folder, number, simulated=simulated)
        conduct(path, robot=Robot(leave_at=leave_at), first=plan(number, simulated=simulated))
    return ratings.run(folder, level=4.0, only="simulated")


def paper(folder: Path, workers: int) -> FrameResult:
    """The beginning of the shipped recording, and a scene."""
    with np.load(OPERATOR) as whole:
        np.savez(folder / OPERATOR.name, **{name: array[:1200] for name, array in whole.items()})
    options = PaperOptions(read_traces([folder / OPERATOR.name]), (SCENES[2],), (0.10,), 1.0)
    return PAPER.result(options, workers=workers)


def evaluated(workers: int) -> FrameResult:
    """The longest trace last, so that tasks are not done in the order of the rows."""
    traces = [NamedTrace(f"walk_{seed}", walk(200 + 200 * seed, seed)) for seed in range(2)]
    study = EvaluationStudy(("zoh", "hybrid"), (0.05, 0.2))
    return EVALUATE.result(EvaluationOptions(study, traces, wire=True, window=None), workers=workers)


def displayed(folder: Path, workers: int) -> FrameResult:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(display, "RUN_S", 1.5)
        return replace(DISPLAY, cases=lambda _: DISPLAYED).result(DisplayOptions(("none",)), workers=1)


EXACT = {"exact": INTEGRATORS["exact"]}


class StudyCase(NamedTuple):
    """A study that runs small.

    Args:
        result: takes an empty folder and the number of processes.
        files: that its figures are.
        rows: their number.
        parallel: whether it runs in processes.
        measured: columns that differ from run to run.
    """

    result: Callable[[Path, int], FrameResult]
    files: set[str]
    rows: int
    parallel: bool = False
    measured: Sequence[str] = ()


STUDIES = {
    "evaluate": StudyCase(
        lambda _, workers: evaluated(workers),
        CURVES | {"curves.csv", "force.png", "force.svg", "force.csv", "error_over_cost.png"},
        8, True, ("tick_us",),
    ),
    "precision": StudyCase(
        lambda _, workers: PRECISION.result(
            Effort(finest=1, repeats=1, problems=[WALL], schemes=EXACT, recommended=("exact", 1)),
            workers=1,
        ),
        {"work_precision.png"}, 3,
    ),
    "stability": StudyCase(
        lambda _, workers: replace(MAP, cases=lambda _: MAPPED).result(MapOptions(), workers=workers),
        {"stability_map.png", "stability_wall.png"}, 5, True,
    ),
    "stability --cells": StudyCase(
        displayed,
        {"stability_display.png"}, 2,
    ),
    "ratings": StudyCase(lambda folder, _: rated(folder), CURVES | {"curves.csv"}, 30),
    "paper": StudyCase(paper, {"the-paper-and-us.md", "packet_rate.png", "quality_over_rate.png", "force.png"}, 15),
}  # fmt: skip


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., FrameResult]:
    """The result of a study by name and number of processes, computed once."""
    return cache(lambda name, workers=1: STUDIES[name].result(tmp_path_factory.mktemp("study"), workers))


@pytest.mark.parametrize("name", STUDIES)
def test_document_table_csv_and_figures_hold_the_rows(
    name: str, small: Callable[..., FrameResult], tmp_path: Path
) -> None:
    case, result = STUDIES[name], small(name)
    document = json.loads(json.dumps(result.document, allow_nan=False))
    assert len(document["rows"]) == len(result.rows) == case.rows
    assert document["environment"]["packages"]["numpy"]
    result.write_csv(tmp_path / "rows.csv")
    with (tmp_path / "rows.csv").open(newline="", encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == case.rows
    result.draw(tmp_path / "new" / "figures")
    drawn = {path.name: path for path in (tmp_path / "new" / "figures").rglob("*") if path.is_file()}
    assert case.files <= drawn.keys()
    assert all(path.stat().st_size > 8 for path in drawn.values())


@pytest.mark.parametrize("name", [name for name, case in STUDIES.items() if case.parallel])
def test_rows_do_not_depend_on_the_number_of_processes(name: str, small: Callable[..., FrameResult]) -> None:
    """To the last bit of every number but run times."""
    one, two = (
        [{key: value for key, value in row.items() if key not in STUDIES[name].measured} for row in small(name, n).rows]
        for n in (1, 2)
    )
    assert json.dumps(one) == json.dumps(two)


# Figures.


def test_equal_figures_are_equal_files_with_their_origin_in_the_metadata(tmp_path: Path) -> None:
    """A name may have a point."""
    made = []
    for folder in (tmp_path / "first", tmp_path / "second"):
        folder.mkdir()
        with drawn_as(Drawing(False, ("png", "svg", "pdf"))):
            figure = sheet(3.0, "A title", "numpy 2.4")
            figure.subplots().plot([0.0, 1.0])
            save(figure, folder / "k=0.10")
        made.append({path.name: path.read_bytes() for path in folder.iterdir()})
    assert made[0] == made[1]
    assert made[0].keys() == {"k=0.10.png", "k=0.10.svg", "k=0.10.pdf"}
    assert all(b"numpy 2.4" in content for content in made[0].values())


# Arguments.

FAR = "t,px,py,pz,fx,fy,fz\n" + "".join(f"{0.01 * i},{30.0 + i},0,0,0,0,{0.01 * i}\n" for i in range(100))
EVALUATION, EXPERIMENT = ("evaluate", OPERATOR), ("experiment", LOOPBACK, "--out", "{here}/out")


@pytest.mark.parametrize(
    ("arguments", "status", "field"),
    [
        *(((*EVALUATION, *more), 2, field) for more, field in [
            (("--predictor", "zoh,zoh"), "--predictor"),
            (("--weber", "often"), "--weber"), (("--weber", "1.5"), "--weber"),
            (("--deadband", "ball"), "--deadband"), (("--deadband", "level_crossing", "--floor", 0), "--floor"),
            (("--deadband", "isotropic,cone", "--plots", "{here}/out"), "--plots"), (("--jnd", 0), "--jnd"),
            (("--lookahead", -1), "--lookahead"), (("--units", "mm,inch"), "--units"),
            (("--units", "mm,m"), "units"), (("--dask", "tcp://h:1", "--workers", 2), "--workers"),
            (("--plots", "{here}/out", "--format", "jpg"), "--format"),
            (("--plots", "{here}/out", "--from", 3600), "--from"), ((OPERATOR,), "listed twice"),
            ((OPERATOR.parent / ".." / "traces" / OPERATOR.name,), "listed twice"), (("absent",), "absent"),
        ]),
        (("evaluate", "tue", "tue_rigid_1"), 2, "listed twice"), (("evaluate", "{here}/far.csv"), 2, "--units"),
        (("evaluate", "{here}/wrong.csv"), 2, "row 1"), (("paper", "{here}/wrong.csv"), 2, "row 1"),
        (("paper", OPERATOR, OPERATOR), 2, "listed twice"), (("stability", "--cells", "--scheme", "x"), 2, "--scheme"),
        (("stability", "--held-out", 1, "--plots", "{here}/out"), 2, "--plots"),
        *(((*EXPERIMENT, *more), 2, field) for more, field in [
            (("--subject", 0), "--subject"), (("--duration", 0), "--duration"), (("--duration", "nan"), "--duration"),
            (("--seed", -1), "--seed"), (("--set", "codec.force.webber=1"), "webber"), ((), "operator"),
        ]),
        (("experiment", LOOPBACK, "--simulate", "--out", LOOPBACK), 2, "--out"),
        (("experiment", LOOPBACK, "--simulate", "--out", "{here}", "--subject", 9), 2, "simulated-009.jsonl:1"),
        (("ratings", "{here}/none"), 2, "no such folder"), (("ratings", "{here}", "--only", "all"), 2, "--only"),
        (("ratings", "{here}", "--level", 5.1), 2, "--level"),
    ],
)  # fmt: skip
def test_a_wrong_argument_is_one_line_before_any_work(
    arguments: tuple[object, ...], status: int, field: str, tmp_path: Path
) -> None:
    (tmp_path / "far.csv").write_text(FAR)
    (tmp_path / "wrong.csv").write_text("a,b\n1,2\n")
    (tmp_path / "simulated-009.jsonl").write_text("{}\n")
    ended = weberlink("study", *(str(each).replace("{here}", str(tmp_path)) for each in arguments))
    assert field in ended.complaint(status)
    assert not (tmp_path / "out").exists()
