"""The shipped pair of arms in virtual time: what is felt, the report and the recording."""

from pathlib import Path
from typing import Any

import pytest

from tests.system.systems import configuration
from weberlink.system.scoring.recorded import put_together
from weberlink.system.simulate import simulate
from weberlink.telemetry.recording.reader import read_recording

pytest.importorskip("mujoco", reason="needs mujoco (extra: mujoco)")

CHANNELS = ("joint_torque", "joint_angle", "gripper_torque", "gripper_angle")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    """The figures of a session that reaches the table, and its recording."""
    path = tmp_path_factory.mktemp("arms") / "arms.mcap"
    summary, _ = simulate(configuration(file="arms.yaml"), 2.2, path)
    return summary, path


def test_shipped_pair_presses_table_and_operator_feels_it(recorded: tuple[dict[str, Any], Path]) -> None:
    summary, _ = recorded
    assert (summary["outcome"], summary["verdict"]["word"]) == ("completed", "good")
    assert min(summary[name]["reduction"] for name in CHANNELS) > 0.9
    torque = summary["joint_torque"]
    assert torque["packets"] > 5
    assert set(torque["axes"]) == {"shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"}
    assert torque["coding"]["error_max_deadbands"] <= 1.0 + 1e-3
    assert summary["energy"]["generated_j"] == 0.0


def test_recording_gives_figures_of_its_session(recorded: tuple[dict[str, Any], Path]) -> None:
    summary, path = recorded
    again = put_together([read_recording(path)]).summary()
    for name in (*CHANNELS, "energy", "limited"):
        assert again[name] == summary[name]
