"""The shipped files: all are valid; of the pair of computed arms, what is felt."""

from pathlib import Path

import pytest

from weberlink.config import load
from weberlink.protocol.keys import generate
from weberlink.session.advice import measured_tick_s
from weberlink_figures.reporting import simulated
from weberlink_figures.verdict import verdict

pytest.importorskip("mujoco", reason="needs mujoco (extra: mujoco)")

CONFIGS = Path(__file__).parents[1] / "configs"
CHANNELS = ("joint_torque", "joint_angle", "gripper_torque", "gripper_angle")


def test_shipped_pair_presses_table_and_operator_feels_it() -> None:
    summary = simulated(load(CONFIGS / "arms.yaml"), 2.2).to_json()
    assert (summary["outcome"], summary["verdict"]["word"]) == ("completed", "good")
    assert min(summary[name]["reduction"] for name in CHANNELS) > 0.9
    torque = summary["joint_torque"]
    assert torque["packets"] > 5
    assert set(torque["axes"]) == {"shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"}
    assert torque["coding"]["error_max_deadbands"] <= 1.0 + 1e-3
    assert summary["energy"]["generated_j"] == 0.0


def test_the_shipped_pair_is_connected_from_start_to_end_at_a_distance() -> None:
    emulate = "link.emulate={delay_ms: 75, jitter_ms: 5, loss: 0.02, seed: 1}"
    figures = simulated(load(CONFIGS / "arms.yaml", ("link.security=none", emulate)), 3.0)
    assert (figures.outcome, figures.faults) == ("completed", {"master": {}, "slave": {}})
    for side in figures.connection.values():
        assert side is not None and (side.interruptions, side.unconnected_s, side.ended) == (0, 0.0, "connected")
    assert {cause.name for cause in verdict(figures).causes} <= {"felt", "delay", "loss"}


@pytest.mark.parametrize("file", ["phantom-arm.yaml", "koch-so101.yaml"])
def test_a_tick_is_measured_with_stand_ins_for_hardware(file: str, tmp_path: Path) -> None:
    key = tmp_path / "key"
    generate(key)
    took = measured_tick_s(load(CONFIGS / file, ["rate_hz=10000", f"link.key_file={key}"]))
    assert took is not None and 2e-6 < took < 0.05
