"""The study as a whole: rows, page, figure and the published ones."""

import json
import re
from dataclasses import asdict, replace
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

from tests.system.systems import CONFIGS
from weberlink.cli import app
from weberlink.studies.adaptive.coding import COMPARED, RateRow
from weberlink.studies.adaptive.command import NUMBERS, PAGE, study
from weberlink.studies.adaptive.comparison import by_group, ratios
from weberlink.studies.adaptive.document import document
from weberlink.studies.adaptive.signals import FULL, QUICK, signals, tasks
from weberlink.studies.evaluate.traces import read_traces
from weberlink.studies.result import StudyResult
from weberlink.system.environment import footer

PUBLISHED = CONFIGS.parent / "docs" / "adaptive"
GIVEN = read_traces([Path("tue_rigid_1"), Path("stroke_iiwa_teleop_1")])
SCOPE = QUICK._replace(recording_s=0.5, scene_s=1.0, synthetic=("texture",))


@pytest.fixture(scope="module")
def small() -> StudyResult:
    return study(GIVEN, SCOPE, 1, lambda *_: None)


def rows_in(result: StudyResult) -> list[RateRow]:
    return [RateRow(**row) for row in result.document["rows"]]


def test_every_signal_is_coded_by_every_predictor_at_every_rate(small: StudyResult) -> None:
    work = tasks(signals(GIVEN, SCOPE), SCOPE)
    rows = rows_in(small)
    assert len(rows) == len(work) * len(COMPARED)
    assert {(row.signal, row.rate_hz, row.predictor) for row in rows} == {
        (task.signal.name, task.rate_hz, predictor) for task in work for predictor in COMPARED
    }
    for row in rows:
        assert row.outside == 0
        assert row.bytes > 0 or row.packets == 0
    json.dumps(small.document, allow_nan=False)


def test_rows_do_not_depend_on_the_number_of_processes(small: StudyResult) -> None:
    def timeless(result: StudyResult) -> list[RateRow]:
        return [replace(row, tick_us=0.0, processor_s=0.0) for row in rows_in(result)]

    assert timeless(study(GIVEN, SCOPE, 2, lambda *_: None)) == timeless(small)


def test_the_printed_table_names_the_groups(small: StudyResult, capsys: pytest.CaptureFixture[str]) -> None:
    Console(width=80).print(small.table)
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    for group in ("tue_rigid", "stroke_iiwa_teleop", "texture", "all 2 sources"):
        assert any(line.startswith(group) for line in lines)
    assert not any("…" in line for line in lines)


def test_page_figure_and_rows_are_written(small: StudyResult, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    small.draw(tmp_path)
    page = (tmp_path / PAGE).read_text(encoding="utf-8")
    for name in re.findall(r"\]\((\w+\.\w+)\)", page):
        assert (tmp_path / name).stat().st_size > 1000
    assert json.loads((tmp_path / NUMBERS).read_text()) == json.loads(json.dumps(small.document))


def test_a_broken_deadband_is_reported(small: StudyResult) -> None:
    rows = rows_in(small)
    assert f"No tick of {len(rows)} runs was outside" in document(rows, SCOPE, "", drawn=False)
    rows[3] = replace(rows[3], outside=2)
    assert f"**Ticks outside their deadband in 1 of {len(rows)} runs**" in document(rows, SCOPE, "", drawn=False)


def test_the_published_page_is_that_of_its_rows() -> None:
    found = json.loads((PUBLISHED / NUMBERS).read_text(encoding="utf-8"))
    rows = [RateRow(**row) for row in found["rows"]]
    assert found["scope"] == json.loads(json.dumps(FULL._asdict())), "publish it again: make figures"
    caption = footer(found["environment"], found["seed"])
    page = document(rows, FULL, caption, drawn=True)
    assert (PUBLISHED / PAGE).read_text(encoding="utf-8") == page
    assert found["groups"] == json.loads(json.dumps([asdict(one) for one in by_group(ratios(rows))]))


def test_the_command_refuses_what_is_not_there() -> None:
    ended = CliRunner().invoke(app, ["study", "adaptive", "absent.csv"])
    assert (ended.exit_code, ended.stdout) == (2, "")
    assert "absent.csv: not found; shipped recordings: " in ended.stderr
