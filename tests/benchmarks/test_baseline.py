"""An earlier run beside this one, and files that are none."""

import json
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from benchmarks.baseline import as_json, differences, figures, read
from benchmarks.study import assemble
from tests.benchmarks.findings import ARRANGEMENT, findings, lateness
from weberlink.system.configuration import ConfigurationError


@pytest.fixture
def document() -> dict[str, Any]:
    """As it comes back from a file."""
    whole: dict[str, Any] = json.loads(json.dumps(assemble(ARRANGEMENT, findings()).document))
    return whole


def save(folder: Path, content: object) -> Path:
    path = folder / "earlier.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


def test_a_run_beside_itself_is_once_itself(document: dict[str, Any], tmp_path: Path) -> None:
    compared = as_json(read(save(tmp_path, document)), document)
    assert compared["differences"] == []
    assert len(compared["figures"]) > 30
    assert len({figure["name"] for figure in compared["figures"]}) == len(compared["figures"])
    assert {figure["ratio"] for figure in compared["figures"]} <= {1.0, None}


def test_each_figure_is_now_over_earlier(document: dict[str, Any]) -> None:
    rates = {hz: lateness(hz, late_us=60.0, cpu_s=2.0) for hz in (1000.0, 2000.0)}
    bench = assemble(ARRANGEMENT, findings(rates=rates), (document, "earlier.json"))
    found = {figure["name"]: figure for figure in bench.document["baseline"]["figures"]}
    assert found["1 kHz lateness p99 [us]"] == {
        "name": "1 kHz lateness p99 [us]", "earlier": 30.0, "now": 60.0, "ratio": 2.0,
    }  # fmt: skip
    assert found["slave CPU, share of a core [%]"]["ratio"] == pytest.approx(2.0)
    assert found["1 kHz slave missed [%]"]["ratio"] is None  # 0 earlier
    assert not [name for name in found if name.startswith("4 kHz")]  # not measured now
    screen = StringIO()
    Console(width=80, file=screen).print(bench.table)
    text = screen.getvalue()
    assert "beside earlier.json" in text
    assert "1 kHz lateness p99 [us]" in text
    assert "the runs differ" not in text


def test_another_machine_is_said(document: dict[str, Any]) -> None:
    other = json.loads(json.dumps(document))
    other["environment"]["machine"] = "Abacus"
    other["environment"]["packages"]["numpy"] = "1.0"
    other["lateness"][0]["limit"]["name"] = "timerfd in Python"
    other["host"]["preemption"] = "none"
    other["duration_s"] = 5.0
    lines = differences(other, document)
    assert [line.partition(":")[0] for line in lines] == [
        "machine", "numpy", "preemption", "duration_s", "limit of lateness",
    ]  # fmt: skip
    assert lines[0].startswith("machine: Abacus earlier, ")
    assert differences(document, document) == []


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ("not json", "is not JSON"),
        ("\udcff".encode("utf-8", "surrogatepass").decode("latin-1"), "is not JSON"),
        ([1, 2], "is not of a bench run"),
        ({"rows": []}, "is not of a bench run"),
        ({"kind": "weberlink bench", "version": 99}, "is of version 99"),
        ({"kind": "weberlink bench", "version": 1}, "lacks figures"),
        ({"kind": "weberlink bench", "version": 1, "lateness": 3}, "lacks figures"),
    ],
)
def test_a_wrong_file_is_one_line(content: object, complaint: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=complaint) as caught:
        read(save(tmp_path, content))
    assert str(caught.value).startswith(f"--baseline: {tmp_path}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("key", ["lateness", "latency", "cpu", "tick_cost", "codec", "memory", "start_up"])
def test_a_document_without_a_part_is_one_line(key: str, document: dict[str, Any], tmp_path: Path) -> None:
    del document[key]
    with pytest.raises(ConfigurationError, match="lacks figures"):
        read(save(tmp_path, document))


def test_a_figure_that_is_no_number_is_one_line(document: dict[str, Any], tmp_path: Path) -> None:
    document["codec"]["live_samples_per_s"] = "many"
    with pytest.raises(ConfigurationError, match="lacks figures"):
        read(save(tmp_path, document))
    assert len(figures(assemble(ARRANGEMENT, findings()).document)) > 30


def test_a_file_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"cannot be read: No such file"):
        read(tmp_path / "nothing.json")
    with pytest.raises(ConfigurationError, match=r"cannot be read: Is a directory"):
        read(tmp_path)
