"""The `paper` command: from recordings and scenes to a page whose numbers are those of the JSON."""

import csv
import re
from dataclasses import replace
from itertools import islice
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.system.systems import CONFIGS
from weberlink.cli import app
from weberlink.master.trace import read_trace
from weberlink.studies.evaluate.study import Recording
from weberlink.studies.paper.claims import CLAIMS
from weberlink.studies.paper.command import PAGE, SCENE_STUDY, SCENES, STUDY, Scope, run
from weberlink.studies.paper.document import PREDICTORS

OPERATOR = CONFIGS / "traces" / "operator.csv"
SMALL = Scope(scenes=(SCENES[2],), webers=(0.10, 0.30), duration_s=3.0)
SMALLER = Scope(scenes=(SCENES[2],), webers=(0.10,), duration_s=1.5)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The beginning of the shipped recording."""
    path = tmp_path_factory.mktemp("recorded") / OPERATOR.name
    with OPERATOR.open(encoding="utf-8") as whole:
        path.write_text("".join(islice(whole, 2500)), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def study(recorded: Path, tmp_path_factory: pytest.TempPathFactory):
    told: list[tuple[int, int, str]] = []
    found = run([recorded], plots=True, workers=1, progress=lambda *state: told.append(state), scope=SMALL)
    folder = tmp_path_factory.mktemp("paper")
    found.draw(folder)
    return found, folder, told


def test_every_claim_is_measured_under_every_condition(study):
    found, _, told = study
    assert [condition["key"] for condition in found.document["conditions"]] == ["recordings", "scenes", "systems"]
    for condition in found.document["conditions"]:
        assert len(condition["claims"]) == len(CLAIMS)
        at_weber = [claim for claim in condition["claims"] if claim["at"] == "weber"]
        assert all(claim["units"] == len(condition["signals"]) for claim in at_weber)
    assert {what for _, _, what in told} == {"simulated sessions", "explored scenes", "signals through the codec"}
    assert told[-1][0] == told[-1][1]


def test_the_recordings_numbers_are_those_of_the_codec(study, recorded):
    found, _, _ = study
    asked = replace(STUDY, predictors=("hybrid", "zoh"), webers=(0.10,))
    rows = {(row.predictor, row.weber): row for row in asked.rows(Recording("operator", read_trace(recorded)))}
    (claim,) = [
        claim
        for claim in found.document["conditions"][0]["claims"]
        if (claim["predictor"], claim["reference"], claim["at"]) == ("hybrid", "zoh", "weber")
    ]
    expected = rows["hybrid", 0.10].packets / rows["zoh", 0.10].packets
    assert claim["measured"] == pytest.approx(1.0 - expected)
    assert claim["ratios"] == {"operator": pytest.approx(expected)}


def test_geometry_saves_on_a_dome_with_the_whole_system(study):
    found, _, _ = study
    rates = {
        (one.unit, one.predictor): one.packets_per_s for one in found.conditions[2].observations if one.weber == 0.10
    }
    assert rates["dome on a plane", "hybrid"] < 0.5 * rates["dome on a plane", "zoh"]
    assert SCENE_STUDY.position_step < STUDY.position_step


def test_the_same_seed_gives_the_same_numbers_whatever_the_number_of_workers(recorded):
    alone, shared = (
        run([recorded], plots=False, workers=workers, progress=lambda *_: None, scope=SMALLER).document["conditions"]
        for workers in (1, 2)
    )
    assert shared == alone
    assert all(claim["ratios"] for claim in alone[2]["claims"] if claim["at"] == "weber")


def test_the_page_has_the_numbers_and_the_figures_that_it_shows(study):
    found, folder, _ = study
    page = (folder / PAGE).read_text(encoding="utf-8")
    pictures = re.findall(r"\]\(([\w/]+\.png)\)", page)
    assert len(pictures) == 3 * 3 + 3
    for picture in pictures:
        assert (folder / picture).stat().st_size > 10_000
        assert (folder / picture).with_suffix(".svg").is_file()
    for condition in found.conditions:
        with (folder / condition.key / "curves.csv").open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        assert {row["predictor"] for row in rows} == set(PREDICTORS)
        assert len(rows) == len(PREDICTORS) * len(SMALL.webers)
    assert found.caption in page


def test_the_whole_command_says_what_is_wrong_with_a_trace_before_it_works(tmp_path: Path):
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("a,b\n1,2\n", encoding="utf-8")
    result = CliRunner().invoke(app, ["paper", str(wrong)])
    assert result.exit_code == 2
    assert "wrong.csv: row 1: missing column" in result.stderr


def test_recordings_of_the_same_name_are_different_signals_and_none_counts_twice(tmp_path: Path):
    copies = [tmp_path / person / "touch.csv" for person in ("one", "other")]
    for copy in copies:
        copy.parent.mkdir()
        copy.write_bytes(OPERATOR.read_bytes())
    scope = Scope(scenes=(SCENES[0],), webers=(0.10,), duration_s=0.5)
    found = run(copies, plots=False, workers=1, progress=lambda *_: None, scope=scope)
    recordings = found.document["conditions"][0]
    assert recordings["signals"] == ["one/touch", "other/touch"]
    assert recordings["claims"][0]["units"] == 2
    result = CliRunner().invoke(app, ["paper", str(copies[0]), str(copies[0])])
    assert result.exit_code == 2
    assert "listed twice" in result.stderr
