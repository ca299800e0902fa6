"""The composition of `weberlink study precision`."""

import json
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from weberlink.studies.precision.command import run
from weberlink.studies.precision.problems import PROBLEMS


def test_a_problem_is_measured_printed_and_drawn(tmp_path: Path) -> None:
    pytest.importorskip("scipy")
    pytest.importorskip("matplotlib")
    told: list[tuple[int, int, str]] = []
    result = run(full=False, plots=True, progress=lambda *what: told.append(what), problems=PROBLEMS[:1])
    assert told == [(0, 1, PROBLEMS[0].name), (1, 1, "done")]
    assert result.interrupted == ""
    document = json.loads(json.dumps(result.document, allow_nan=False))
    assert [problem["problem"] for problem in document["problems"]] == [PROBLEMS[0].name]
    assert document["environment"]["machine"]
    console = Console(width=80, file=StringIO())
    with console.capture() as printed:
        console.print(result.table)
    text = printed.get()
    assert "integrator: auto" in text
    assert max(map(len, text.splitlines())) <= 80
    result.draw(tmp_path / "figures")
    assert (tmp_path / "figures" / "work_precision.png").stat().st_size > 10_000
