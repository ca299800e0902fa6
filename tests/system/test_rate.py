"""A bounded rate of updates in a session: every channel keeps it, and the report, the recording and `check` say so."""

import json
from io import StringIO
from pathlib import Path
from typing import Any

from rich.console import Console
from typer.testing import CliRunner

from tests.system.systems import CONFIGS, configuration
from weberlink.apps.recordings import describe
from weberlink.cli import app
from weberlink.codec.rate import LEAST_BURST
from weberlink.system import check
from weberlink.system.report import session_report
from weberlink.system.simulate import simulate

FILE = "rotation.yaml"
MOST = 5.0
SECONDS = 5.0
CHANNELS = {
    "force": "force",
    "position": "position",
    "torque": "rotation.torque",
    "orientation": "rotation.orientation",
}
NARROW = (
    "codec.force.weber=0", "codec.force.floor_n=0.001", "codec.position.weber=0", "codec.position.bound_m=0.00001",
    "codec.rotation.torque.weber=0", "codec.rotation.torque.floor_nm=0.0001", "codec.rotation.orientation.weber=0",
    "codec.rotation.orientation.bound_rad=0.0001",
)  # fmt: skip
BOUNDED = tuple(
    f"codec.{key}.max_updates_per_s={MOST:g}"
    for key in ("force", "position", "rotation.torque", "rotation.orientation")
)


def text_of(summary: dict[str, Any]) -> str:
    shown = StringIO()
    session_report(summary, "title", Console(width=80, file=shown))
    return shown.getvalue()


def test_every_channel_keeps_its_rate_and_the_report_says_so(tmp_path: Path) -> None:
    free, _ = simulate(configuration(*NARROW, file=FILE), SECONDS)
    path = tmp_path / "r.mcap"
    bounded, _ = simulate(configuration(*NARROW, *BOUNDED, file=FILE), SECONDS, path)
    recorded, told = describe([path]).document, text_of(bounded)
    assert bounded["outcome"] == "completed"
    for name in CHANNELS:
        assert free[name]["packets"] > 2 * (MOST * SECONDS + LEAST_BURST)
        assert free[name]["widened_fraction"] == 0.0
        assert free[name]["widened_max"] is None
        assert bounded[name]["packets"] <= MOST * SECONDS + LEAST_BURST + 2, "and one forced at the beginning"
        assert 0.2 < bounded[name]["widened_fraction"] <= 1.0
        assert bounded[name]["widened_max"] > 0.0
        assert f"{name}: deadband widened in " in told
        for figure in ("widened_fraction", "widened_max"):
            assert recorded[name][figure] == bounded[name][figure]
    assert bounded["force"]["coding"]["violation_fraction"] == 0.0
    assert "widened" not in text_of(free)


def test_check_says_the_rate() -> None:
    described = "\n".join(check.describe(configuration("codec.position.max_updates_per_s=100")))
    assert "at most 100 updates/s" in described


def test_a_study_bounds_the_rate_of_a_recorded_signal(tmp_path: Path) -> None:
    trace = CONFIGS / "traces" / "operator.npz"
    arguments = ["study", "evaluate", str(trace), "--predictor", "zoh", "--floor", "0.002", "--weber", "0.01"]
    rows = []
    for further in ([], ["--max-updates", "40"]):
        out = tmp_path / "rows.json"
        result = CliRunner().invoke(app, [*arguments, *further, "--json", str(out)])
        assert result.exit_code == 0, result.output
        rows.append(json.loads(out.read_text())["rows"][0])
    free, bounded = rows
    duration = bounded["packets"] / bounded["packets_per_s"]
    assert bounded["packets"] <= 40 * duration + 20 < free["packets"]
    assert bounded["violation_fraction"] == 0.0
    assert 0.0 < bounded["widened_fraction"] <= 1.0
    assert bounded["widened_max_n"] > 0.002
    assert "widened_fraction" not in free
    assert "deadband widened in up to" in result.output
