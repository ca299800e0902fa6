"""The shipped pair of arms in virtual time: what is felt, and the report."""

import pytest

from tests.system.systems import configuration
from weberlink.system.simulate import simulate

pytest.importorskip("mujoco", reason="needs mujoco (extra: mujoco)")

CHANNELS = ("joint_torque", "joint_angle", "gripper_torque", "gripper_angle")


def test_shipped_pair_presses_table_and_operator_feels_it() -> None:
    summary, _ = simulate(configuration(file="arms.yaml"), 2.2)
    assert (summary["outcome"], summary["verdict"]["word"]) == ("completed", "good")
    assert min(summary[name]["reduction"] for name in CHANNELS) > 0.9
    torque = summary["joint_torque"]
    assert torque["packets"] > 5
    assert set(torque["axes"]) == {"shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"}
    assert torque["coding"]["error_max_deadbands"] <= 1.0 + 1e-3
    assert summary["energy"]["generated_j"] == 0.0
