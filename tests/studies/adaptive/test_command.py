"""The `adaptive` command: from recordings and scenes to a page, figures and rows."""

import json
import re
from itertools import islice
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from tests.system.systems import CONFIGS
from weberlink.cli import app
from weberlink.studies.adaptive.command import NUMBERS, PAGE
from weberlink.studies.adaptive.words import FIGURES

OPERATOR = CONFIGS / "traces" / "operator.csv"


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> tuple[Result, Path]:
    """A glance, in this process alone."""
    folder = tmp_path_factory.mktemp("adaptive")
    result = CliRunner().invoke(
        app, ["adaptive", "--quick", "--workers", "1", "--json", "-", "--docs", str(folder / "docs")]
    )
    return result, folder / "docs"


def test_a_glance_measures_everything(ran: tuple[Result, Path]) -> None:
    result, _ = ran
    assert (result.exit_code, result.stderr) == (0, "")
    found = json.loads(result.stdout)
    assert found["quick"] is True
    assert found["recordings"] == ["operator"]
    assert {row["part"] for row in found["rates"]} == {"rates", "noise-free", "ablation", "tuning"}
    assert not any(row["outside"] for row in found["rates"] + found["matches"])
    assert [row["variant"] for row in found["costs"]] == ["hybrid", "adaptive"]
    assert not any(row["differing"] for row in found["costs"])
    assert len(found["targets"]) == 9


def test_the_page_shows_figures_that_are_there(ran: tuple[Result, Path]) -> None:
    _, folder = ran
    page = (folder / PAGE).read_text(encoding="utf-8")
    pictures = re.findall(r"\]\(([\w/]+\.png)\)", page)
    assert sorted(pictures) == sorted(f"{name}.png" for name in FIGURES)
    for picture in pictures:
        assert (folder / picture).stat().st_size > 10_000
        assert (folder / picture).with_suffix(".svg").is_file()
    assert json.loads((folder / NUMBERS).read_text(encoding="utf-8"))["rates"]
    assert "nan" not in page


def test_wrong_and_repeated_traces_are_refused_before_any_work(tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("a,b\n1,2\n", encoding="utf-8")
    result = CliRunner().invoke(app, ["adaptive", str(wrong)])
    assert result.exit_code == 2
    assert "wrong.csv: row 1: missing column" in result.stderr
    short = tmp_path / "short.csv"
    with OPERATOR.open(encoding="utf-8") as whole:
        short.write_text("".join(islice(whole, 300)), encoding="utf-8")
    result = CliRunner().invoke(app, ["adaptive", str(short), str(short)])
    assert result.exit_code == 2
    assert "listed twice" in result.stderr
