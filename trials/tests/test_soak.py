"""A soak of seconds: a live session, a cut and copied datagrams from outside break no law, and nothing is left."""

import json
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.program import ROOT
from tests.wait import PATIENCE
from weberlink.telemetry.runtime_directory import Places

pytestmark = pytest.mark.realtime


@pytest.mark.parametrize(
    "faults", [("cut_to_master", "stolen_path", "many_calls"), pytest.param((), id="every", marks=pytest.mark.hunt)]
)
def test_faults_break_no_law_and_nothing_is_left(faults: tuple[str, ...], tmp_path: Path) -> None:
    # Only processes can be cut off and counted from outside; such faults in virtual time are in tests/safety.
    out = tmp_path / "soak.json"
    command = [sys.executable, "-m", "trials.soak", "--minutes", "0.01", "--seed", "5", "--json", str(out)]
    chosen = ["--faults", *faults] if faults else []
    with TemporaryDirectory(dir=Places().memory()) as own:  # others run sessions here too
        environment = os.environ | {"XDG_RUNTIME_DIR": own}
        ended = subprocess.run(
            [*command, *chosen], cwd=ROOT, env=environment, capture_output=True, text=True, timeout=5 * PATIENCE,
            check=False,
        )  # fmt: skip
        left = sorted(path.name for path in Path(own).rglob("*") if path.is_file())
    told = json.loads(out.read_text(encoding="utf-8"))
    assert (ended.returncode, ended.stderr, told["failures"]) == (0, "", []), ended.stdout
    assert {kind["count"] for kind in told["kinds"].values()} == {1}
    assert set(told["kinds"]) >= set(faults)
    assert told["ticks"] > 1000
    assert left == []
