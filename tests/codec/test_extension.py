"""A predictor and a deadband of another distribution, named in a configuration file: those of docs/library.md."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from tests.session.packages import install

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "library.md").read_text(encoding="utf-8")
MODULES = {
    name: next(block for block in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL) if f"# {name}.py" in block)
    for name in ("my_predictors", "my_deadbands")
}
ENTRY_POINTS = re.findall(r'\[project\.entry-points\."(.*?)"\]\n(.*)\n', PAGE)
VALID = [
    (["codec.force.bank=[zoh, damped]", "codec.position.predictor=damped"], ["zoh", "damped"], "ForceDeadband"),
    (["codec.force.predictor=adaptive", "codec.force.bank=[damped, path]"], ["damped", "path"], "ForceDeadband"),
    (["codec.force.deadband={shape: constant, bound_n: 0.1}"], None, "Constant(width=0.1)"),
]
WRONG = [
    ("codec.force.predictor=damper", "codec.force.predictor: should be 'zoh'"),
    ("codec.force.deadband={shape: constant, bound_n: 9}", "deadband.bound_n: should be less than or equal to 5"),
]
SCRIPT = """
import json, sys
from pathlib import Path
from weberlink import ConfigurationError, load, simulate
from weberlink.session.composition.channels import channels

def run(overrides):
    try:
        configuration = load(Path("configs/loopback.yaml"), overrides)
    except ConfigurationError as error:
        return str(error)
    figures, _ = simulate(configuration, 1.0)
    channel = channels(configuration.system)[1]
    return [figures.outcome, figures.felt.packets, channel.bank, repr(channel.deadband)]

print(json.dumps([run(overrides) for overrides in json.loads(sys.argv[1])]))
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    """Of all sets of overrides, by one process in which the distribution is installed."""
    text = "".join(f"[{group}]\n{line.replace(chr(34), '')}\n" for group, line in ENTRY_POINTS)
    folder = install(tmp_path_factory.mktemp("site"), "my-codec", MODULES, text)
    asked: list[Sequence[str]] = [*(overrides for overrides, _, _ in VALID), *([override] for override, _ in WRONG)]
    ran = subprocess.run(
        [sys.executable, "-c", SCRIPT, json.dumps(asked)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(folder)},
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    found: list[Any] = json.loads(ran.stdout)
    return found


@pytest.mark.parametrize("index", range(len(VALID)))
def test_an_installed_entry_can_be_named_in_the_file(results: list[Any], index: int) -> None:
    _, bank, deadband = VALID[index]
    outcome, packets, found, shape = results[index]
    assert outcome == "completed"
    assert packets > 0
    assert bank is None or found == bank
    assert deadband in shape


@pytest.mark.parametrize("index", range(len(WRONG)))
def test_wrong_settings_of_an_installed_entry_are_one_line(results: list[Any], index: int) -> None:
    assert WRONG[index][1] in results[len(VALID) + index]
