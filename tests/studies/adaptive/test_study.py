"""The `adaptive` command and the signals that it codes."""

import json
import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.system.systems import CONFIGS
from weberlink.cli import app
from weberlink.master.trace import Trace, read_trace
from weberlink.studies.adaptive.command import NUMBERS, PAGE, study
from weberlink.studies.adaptive.document import FIGURES
from weberlink.studies.adaptive.signals import (
    CHOSEN_RECORDINGS,
    FULL,
    NOISE_N,
    QUICK,
    AdaptiveScope,
    Half,
    recordings,
    scenes,
)
from weberlink.studies.adaptive.work import ABLATION, EQUAL, RATES, TUNING, length, tasks
from weberlink.studies.evaluate.traces import NamedTrace
from weberlink.studies.result import StudyResult

OPERATOR = CONFIGS / "traces" / "operator.csv"
TINY = QUICK._replace(duration_s=0.8, ticks=400, scenes=("plane_friction",))
TWELVE = [f"omega3_{n}" for n in (1, 13, 19, 7)] + [
    f"tue_{what}_{n}" for what in ("foam", "free", "rigid", "spring") for n in (1, 2)
]


def given(*names: str) -> list[NamedTrace]:
    time = np.arange(50.0) * 1e-3
    empty = np.zeros((50, 3))
    return [NamedTrace(name, Trace(time, empty, empty, np.zeros((0, 2)))) for name in names]


@pytest.fixture(scope="module")
def tiny() -> StudyResult:
    return study([NamedTrace("operator", read_trace(OPERATOR))], TINY, 1, lambda *_: None)


def test_a_small_study_measures_every_part(tiny: StudyResult) -> None:
    found = json.loads(json.dumps(tiny.document, allow_nan=False))
    assert found["recordings"] == ["operator"]
    assert {row["part"] for row in found["rates"]} == {"rates", "noise-free", "ablation", "tuning"}
    assert not any(row["outside"] for row in found["rates"] + found["matches"])
    assert [row["variant"] for row in found["costs"]] == ["hybrid", "adaptive"]
    assert not any(row["differing"] for row in found["costs"])
    assert len(found["targets"]) == 9


def test_the_page_shows_figures_that_exist(tiny: StudyResult, tmp_path: Path) -> None:
    tiny.draw(tmp_path)
    page = (tmp_path / PAGE).read_text(encoding="utf-8")
    pictures = re.findall(r"\]\(([\w/]+\.png)\)", page)
    assert sorted(pictures) == sorted(f"{name}.png" for name in FIGURES)
    for picture in pictures:
        assert (tmp_path / picture).stat().st_size > 10_000
        assert (tmp_path / picture).with_suffix(".svg").is_file()
    assert json.loads((tmp_path / NUMBERS).read_text(encoding="utf-8"))["rates"]
    assert "nan" not in page


def test_wrong_traces_are_refused_before_any_work(tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("a,b\n1,2\n", encoding="utf-8")
    result = CliRunner().invoke(app, ["adaptive", str(wrong)])
    assert result.exit_code == 2
    assert "wrong.csv: row 1: missing column" in result.stderr


def test_halves_are_disjoint_and_complete() -> None:
    found = recordings(given(*TWELVE), FULL) + scenes(FULL, NOISE_N)
    names = {half: {source.key.name for source in found if source.key.half == half} for half in get_args(Half)}
    assert not names["chosen"] & names["reported"]
    assert names["chosen"] | names["reported"] == {source.key.name for source in found}
    assert names["chosen"] & set(TWELVE) == CHOSEN_RECORDINGS
    seeds = {half: {source.seed for source in found if source.key.half == half} - {0} for half in get_args(Half)}
    assert seeds == {"chosen": {1}, "reported": {2, 3}}
    (other,) = recordings(given("mine"), FULL)
    assert other.key.half == "reported"


def test_groups_are_scenes_and_single_recordings() -> None:
    assert {source.key.group for source in scenes(FULL, 0.0)} == set(FULL.scenes)
    assert len({source.key.group for source in recordings(given(*TWELVE), FULL)}) == 12


@pytest.mark.parametrize("scope", [FULL, QUICK])
def test_constants_are_judged_on_the_other_half(scope: AdaptiveScope) -> None:
    for task in tasks(given(*TWELVE), scope):
        if task.source.key.half == "chosen":
            assert not {ABLATION, EQUAL} & set(task.parts)
        else:
            assert TUNING not in task.parts
        assert length(task) > 0.0
    rated = [task.source.key.name for task in tasks(given(*TWELVE), scope) if RATES in task.parts]
    assert len(rated) == len(set(rated)) == 12 + len(scope.scenes) * len(scope.seeds)


def test_noise_is_added_to_the_force_alone() -> None:
    scope = QUICK._replace(duration_s=0.2)
    clean, noisy = (scenes(scope, noise, [3])[0].signal() for noise in (0.0, NOISE_N))
    assert np.array_equal(clean.position_m, noisy.position_m)
    assert np.std(noisy.force_n - clean.force_n) == pytest.approx(NOISE_N, rel=0.2)
