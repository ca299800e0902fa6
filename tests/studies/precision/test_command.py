"""The composition of `weberlink study precision`."""

import json
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from tests.system.systems import CONFIGS
from weberlink.studies.precision import coding
from weberlink.studies.precision.command import codec, combined, run
from weberlink.studies.precision.problems import PROBLEMS
from weberlink.system.configuration import load
from weberlink.system.simulate import simulate


def test_one_count_leads_through_all_parts() -> None:
    told: list[tuple[int, int, str]] = []
    run(
        full=False, plots=False, progress=lambda *what: told.append(what), problems=PROBLEMS[:1],
        scenes=[], recorded_ticks=1500,
    )  # fmt: skip
    done, whole, what = zip(*told, strict=True)
    assert list(done) == [0, 1, 1, 2]
    assert set(whole) == {2}
    assert what[0] == PROBLEMS[0].name


def test_the_codec_is_studied_on_simulated_signals(tmp_path: Path) -> None:
    told: list[tuple[int, int, str]] = []
    section = codec(["scene-plane"], 1.5, "made here", lambda *what: told.append(what), recorded_ticks=1500)
    assert told == [
        (0, 3, "signal of scene-plane"),
        (1, 3, "coding operator"),
        (2, 3, "coding scene-plane"),
        (3, 3, "done"),
    ]
    assert section.document["signal_s"]["scene-plane"] == pytest.approx(1.5, abs=0.1)
    assert {row["trace"] for row in section.document["rows"]} == {"operator", "scene-plane"}
    unrounded = simulate(load(CONFIGS / "scene-plane.yaml"), 1.5)[1].trace
    for row, of_unrounded in zip(
        [row for row in section.document["rows"] if row["trace"] == "scene-plane"],
        coding.study({"scene-plane": unrounded}).rows,
        strict=True,
    ):
        assert row["error_rms_n"] == of_unrounded.error_rms_n
    whole = combined(
        {"codec": section}, {"machine": "m", "cores": 1, "system": "s", "python": "p", "packages": {}, "commit": None}
    )
    assert json.loads(json.dumps(whole.document, allow_nan=False))["codec"]["rows"] == section.document["rows"]
    console = Console(width=80, file=StringIO())
    with console.capture() as printed:
        console.print(whole.table)
    text = printed.get()
    assert "hybrid is " in text
    assert max(map(len, text.splitlines())) <= 80
    whole.draw(tmp_path / "figures")
    assert (tmp_path / "figures" / "coding.png").stat().st_size > 10_000
