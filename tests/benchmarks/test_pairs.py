"""Two programs beside each other."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.arrangement import ROOT
from benchmarks.pairs import A, B, compare

SOURCE = Path(ROOT) / "src"


def test_ratios_are_of_the_same_pair() -> None:
    pairs = [
        {A: {"work [us]": 100.0, "missed [%]": 0.0}, B: {"work [us]": 50.0, "missed [%]": 0.1}},
        {A: {"work [us]": 400.0, "missed [%]": 0.0}, B: {"work [us]": 240.0, "missed [%]": 0.0}},
        {A: {"work [us]": 100.0, "missed [%]": 0.2}, B: {"work [us]": 80.0, "missed [%]": 0.1}},
    ]
    work, missed = compare(pairs)
    assert work == {
        "name": "work [us]", "a": 100.0, "b": 80.0,
        "ratio": pytest.approx(0.6), "least": pytest.approx(0.5), "most": pytest.approx(0.8),
    }  # fmt: skip
    assert (missed["a"], missed["b"]) == (0.0, 0.1)
    assert missed["ratio"] == missed["least"] == missed["most"] == pytest.approx(0.5)  # nothing is over zero


def pairs(*arguments: object) -> subprocess.CompletedProcess[str]:
    line = [sys.executable, "-m", "benchmarks.pairs", *map(str, arguments)]
    return subprocess.run(line, cwd=ROOT, capture_output=True, text=True, check=False)


def test_a_folder_without_the_program_is_one_line(tmp_path: Path) -> None:
    ended = pairs(tmp_path, SOURCE, "--pairs", "1")
    assert (ended.returncode, ended.stdout) == (1, "")
    assert f"{tmp_path}: holds no package weberlink" in ended.stderr
    assert ended.stderr.count("\n") == 1
    assert pairs(SOURCE, SOURCE, "--pairs", "0").returncode == 2


@pytest.mark.hunt  # half a minute alone on the machine
@pytest.mark.realtime(alone=True)
def test_the_program_of_each_folder_is_measured(tmp_path: Path) -> None:
    """The second folder holds a slower copy: it sleeps before it does anything."""
    slow = tmp_path / "slow" / "weberlink"
    slow.mkdir(parents=True)
    package = SOURCE / "weberlink"
    for entry in package.iterdir():
        if entry.name != "__init__.py":
            (slow / entry.name).symlink_to(entry.resolve())
    text = (package / "__init__.py").read_text(encoding="utf-8")
    (slow / "__init__.py").write_text(f"{text}\nimport time\n\ntime.sleep(1.0)\n", encoding="utf-8")
    out = tmp_path / "pairs.json"
    ended = pairs(SOURCE, slow.parent, "--pairs", "1", "--duration", "1", "--json", out)
    assert (ended.returncode, ended.stderr) == (0, "")
    document = json.loads(out.read_text(encoding="utf-8"))
    found = {row["name"]: row for row in document["compared"]}
    assert found["start [s]"]["b"] > found["start [s]"]["a"] + 1.0
    for side in ("master", "slave"):
        assert found[f"{side} CPU [%]"]["a"] > 0.0
        assert found[f"{side} work p50 [us]"]["b"] > 0.0
    assert found["codec [samples/s]"]["a"] > 0.0
    assert document["steal_share"] is not None
    assert "steal" in ended.stdout
