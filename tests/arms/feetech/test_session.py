"""A live session of an emulated SO-101 leader and follower, through the daemons and the link."""

import os
import signal
from pathlib import Path

import pytest

from tests.program import Program, free_port
from tests.wait import until
from weberlink.arms.emulators.feetech import (
    So101FollowerEmulator,
    So101FollowerEmulatorOptions,
    So101LeaderEmulator,
    So101LeaderEmulatorOptions,
    Wall,
)
from weberlink.hardware.emulator import PtyDevice

pytestmark = [pytest.mark.realtime, pytest.mark.hunt]

SESSION = """
link: {{listen: "127.0.0.1:{port}", slave: "127.0.0.1:{port}", security: session, silence_ms: 2000}}
codec:
  joints: {{names: [shoulder_pan, shoulder_lift, elbow_flex, wrist_flex, wrist_roll]}}
  gripper: {{}}
master:
  device: {{driver: so101_leader, port: "{leader}", reconnect_s: 5}}
  limits: {{device_ms: 2000}}
slave:
  robot: {{driver: so101_follower, port: "{follower}", reconnect_s: 5}}
  limits: {{robot_ms: 2000}}
"""


def test_wall_is_felt_until_the_master_is_killed(tmp_path: Path) -> None:
    leader = So101LeaderEmulator(So101LeaderEmulatorOptions(hand_rad=(0.0, 0.0, 0.6, 0.0, 0.0, 0.0)))
    wall = Wall(joint="elbow_flex", angle_rad=0.15, stiffness_nm_rad=30.0)
    follower = So101FollowerEmulator(So101FollowerEmulatorOptions(walls=(wall,)))
    with PtyDevice(leader, tmp_path / "leader") as lead, PtyDevice(follower, tmp_path / "follower") as follow:
        file = tmp_path / "session.yaml"
        file.write_text(SESSION.format(port=free_port(), leader=lead.path, follower=follow.path))
        with Program("loopback", file) as program:
            master = program.engaged("master")
            until(lambda: follower.outside_nm[2] < -0.5, "the follower to press on the wall")
            until(lambda: leader.torques_on[2] and leader.motor_nm[2] < -0.05, "the operator to feel the wall")
            assert master.last["joint_output"][2] < 0.0
            (daemon,) = [pid for pid, command in program.children().items() if b'"side": "master"' in command]
            os.kill(daemon, signal.SIGKILL)
            until(lambda: not any(leader.torques_on), "the guardian to take the torque off")
            assert all(follower.torques_on), "the follower holds"
