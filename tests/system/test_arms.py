"""Sessions in joint space in virtual time: the shipped pair of arms, wrong files, the report and the recording."""

from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from tests.system.systems import CONFIGS, configuration
from weberlink.cli import app
from weberlink.protocol.states import State
from weberlink.system.composition.link import agreement
from weberlink.system.configuration import ConfigurationError, load
from weberlink.system.report import session_report
from weberlink.system.scoring.recorded import put_together
from weberlink.system.simulate import build_simulation, simulate
from weberlink.system.simulation import as_array
from weberlink.telemetry.record import JOINTS
from weberlink.telemetry.recording.reader import read_recording

pytest.importorskip("mujoco", reason="needs mujoco (extra: mujoco)")

FILE = "arms.yaml"
CHANNELS = ("joint_torque", "joint_angle", "gripper_torque", "gripper_angle")
LONGEST_S = 2.2
"""Of a run that reaches the table [s]."""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    """The figures of a session of the shipped file, and its recording."""
    path = tmp_path_factory.mktemp("arms") / "arms.mcap"
    summary, _ = simulate(configuration(file=FILE), LONGEST_S, path)
    return summary, path


def test_shipped_pair_presses_table_and_operator_feels_it(recorded: tuple[dict[str, Any], Path]) -> None:
    summary, _ = recorded
    assert summary["outcome"] == "completed"
    assert summary["verdict"]["word"] == "good"
    for name in CHANNELS:
        assert summary[name]["reduction"] > 0.9
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


def test_report_fits_80_columns(recorded: tuple[dict[str, Any], Path]) -> None:
    text = StringIO()
    session_report(recorded[0], "weberlink simulate arms.yaml", Console(width=80, file=text))
    assert max(map(len, text.getvalue().splitlines())) <= 80
    assert "joint torque" in text.getvalue()
    assert "…" not in text.getvalue()


def test_every_axis_stays_within_its_deadband_without_faults() -> None:
    built = configuration(file=FILE)
    joints, gripper = built.system.codec.joints, built.system.codec.gripper
    assert joints is not None
    assert gripper is not None
    floors = np.array([*[joints.torque.floor_nm] * (len(JOINTS) - 1), gripper.torque.floor_nm], dtype=float)
    webers = np.array([*[joints.torque.weber] * (len(JOINTS) - 1), gripper.torque.weber])
    simulation = build_simulation(built)
    records = as_array([simulation.step()[1] for _ in range(round(LONGEST_S * 1000))])
    counted = records[(records["state"] == State.ENGAGED.value) & (records["ramping"] == 0)]
    assert len(counted) > 1000
    raw, held = counted["joint_raw"].astype(float), counted["joint_decoded"].astype(float)
    assert np.abs(raw).max() > 0.1
    assert (np.abs(held - raw) <= np.maximum(webers * np.abs(raw), floors) * (1 + 1e-6) + 1e-6).all()


def test_one_way_cut_ends_torque_and_holds_follower() -> None:
    cut = "link.emulate.to_master={blackouts_s: [[1.5, 1]]}"
    simulation = build_simulation(configuration(cut, "link.emulate.delay_ms=5", file=FILE))
    pairs = [simulation.step() for _ in range(2300)]
    masters, slaves = (as_array([pair[side] for pair in pairs]) for side in (0, 1))
    assert np.abs(masters["joint_output"][1480]).max() > 0.05
    assert (masters["joint_output"][1800:2300] == 0.0).all()
    assert (slaves["joint_output"][2000:2300] == slaves["joint_output"][2000]).all()


def test_agreement_names_only_what_a_session_uses() -> None:
    of_arms, of_hand = (agreement(configuration(file=file).system) for file in (FILE, "loopback.yaml"))
    assert not any(name.startswith(("codec.force", "codec.position", "codec.rotation")) for name in of_arms)
    assert not any(name.startswith(("codec.joints", "codec.gripper")) for name in of_hand)


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("codec.joints.names=[a, a]", "codec.joints: names: names each joint once"),
        ("codec.joints.names=[a, b]", "codec.joints.names: a, b; but master.device arm_operator has shoulder_pan"),
        ("codec.joints.angle.bound_rad=[0.1]", "angle.bound_rad has 1 values for 5 axes; give one for each"),
        ("codec.joints.torque.predictor=hybrid", "codec.joints.torque.predictor"),
        ("codec.gripper=null", "codec.gripper: master.device arm_operator has a gripper; add gripper: {}"),
        ("codec.joints=null", "gripper: belongs to an arm; give its joints too"),
        ("codec.rotation={}", "an arm has no rotation of its own"),
        ("master.mapping={}", "master.mapping: has no meaning for an arm"),
        ("slave.limits.joints={upper_rad: -3}", "slave.limits.joints: leaves nothing of the range of shoulder_pan"),
        ("master.limits.joints={torque_nm: [1, 2]}", "master.limits.joints.torque_nm: has 2 values for 6 axes"),
        ("codec.joints.torque.step_nm=0.00001", "codec.joints.torque.step_nm: spans 0.32767 N m but slave.robot"),
        ("master.engage={button: 0}", "master.engage.button: arm_operator has no button, not 0"),
        ("master.device.driver=operator", "driver"),
        ("codec.joints.angle.bound_rad=[0.1, -1, 0.1, 0.1, 0.1]", "codec.joints.angle.bound_rad.1: should be greater"),
    ],
)
def test_wrong_file_is_told_with_its_place(override: str, expected: str) -> None:
    with pytest.raises(ConfigurationError, match=r"arms\.yaml") as error:
        build_simulation(load(CONFIGS / FILE, [override]))
    assert expected in str(error.value)


def test_check_describes_both_arms_and_warns_of_missing_coupling() -> None:
    shown = CliRunner().invoke(app, ["check", str(CONFIGS / FILE), "--set", "codec.joints.angle.coupling_nm_rad=null"])
    assert shown.exit_code == 0
    for words in ("5 joints and a gripper", "leader arm_operator", "follower mujoco_arm", "UDP payload"):
        assert words in shown.output
    assert "codec.joints.angle.coupling_nm_rad: not given" in " ".join(shown.output.split())
