"""A soak of seconds: a live session, a cut and copied datagrams from outside break no law, and nothing is left."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.program import ROOT
from tests.wait import PATIENCE
from weberlink.telemetry.runtime_directory import directories

pytestmark = pytest.mark.realtime(alone=True)


def rings() -> set[Path]:
    return {path for folder in directories() for path in folder.glob("weberlink-*.ring")}


@pytest.mark.parametrize(
    "faults", [("cut_to_master", "stolen_path"), pytest.param((), id="every", marks=pytest.mark.hunt)]
)
def test_faults_break_no_law_and_nothing_is_left(faults: tuple[str, ...], tmp_path: Path) -> None:
    # Only processes can be cut off and counted from outside; such faults in virtual time are in tests/safety.
    out, before = tmp_path / "soak.json", rings()
    command = [sys.executable, "-m", "trials.soak", "--minutes", "0.01", "--seed", "5", "--json", str(out)]
    chosen = ["--faults", *faults] if faults else []
    ended = subprocess.run(
        [*command, *chosen], cwd=ROOT, capture_output=True, text=True, timeout=5 * PATIENCE, check=False
    )
    told = json.loads(out.read_text(encoding="utf-8"))
    assert (ended.returncode, ended.stderr, told["failures"]) == (0, "", []), ended.stdout
    assert {kind["count"] for kind in told["kinds"].values()} == {1}
    assert set(told["kinds"]) >= set(faults)
    assert told["ticks"] > 1000
    assert rings() <= before
