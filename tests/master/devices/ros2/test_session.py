"""A node of a third party leads the robot of a live session: zenoh-ros2-sdk 0.1.8 (ROBOTIS, Apache-2.0)."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from time import monotonic

import numpy as np
import pytest

from tests.program import ENGAGED, PATIENT, ROOT, Program, Telemetry
from tests.ros2.ports import endpoint
from tests.wait import until
from weberlink.geometry.vector import Vector, distance

pytestmark = [
    pytest.mark.realtime,
    pytest.mark.skipif(find_spec("zenoh_ros2_sdk") is None, reason="needs zenoh-ros2-sdk==0.1.8"),
]

HOME: Vector = (0.0, 0.0, 0.03)
FREE: Vector = (0.03, 0.02, 0.03)
PRESSED: Vector = (0.03, 0.02, -0.02)
"""Below the wall at z = 0 [m]."""
SILENCE_S = 0.5
"""Longer than by default: a busy machine makes a pose late by 100 ms."""
HAND_N_M, WALL_N_M = 150.0, 1500.0
DEPTH = 0.02 * HAND_N_M / (HAND_N_M + WALL_N_M)
"""Of the handle in the wall: two springs in series [m]."""


class SdkPublisher:
    """The SDK in a process of its own."""

    def __init__(self, folder: Path, router: str) -> None:
        port = router.rpartition(":")[2]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.master.devices.ros2.sdk_publisher", str(folder), port, "100"],
            cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip

    def begun(self) -> str:
        """Its key, once it can publish."""
        assert self.process.stdout is not None
        return self.process.stdout.readline().strip()

    def lead(self, target: Vector | None) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{' '.join(map(str, target or ()))}\n")
        self.process.stdin.flush()

    def kill(self) -> None:
        self.process.kill()
        self.process.communicate()


@contextmanager
def led(folder: Path) -> Iterator[tuple[Program, Telemetry, Telemetry, SdkPublisher]]:
    """A session of configs/ros2.yaml, its telemetry, and the publisher, which publishes nothing yet."""
    router = endpoint()
    given = ("control.scheme=none", f"master.device.connect={router}", f"master.device.silence_ms={SILENCE_S * 1e3}")
    settings = [each for text in given for each in ("--set", text)]
    with Program("loopback", "configs/ros2.yaml", "--duration", "60", *PATIENT, *settings) as program:
        master = program.engaged("master")
        sdk = SdkPublisher(folder, router)
        try:
            assert sdk.begun().startswith("0/weberlink/target/geometry_msgs::msg::dds_::PoseStamped_/RIHS01_10f3786d")
            yield program, master, program.engaged("slave"), sdk
        finally:
            sdk.kill()


def listener_of(daemon: int) -> int:
    """Process id of the listener of a daemon."""
    children = Path(f"/proc/{daemon}/task/{daemon}/children").read_text().split()
    assert len(children) == 1
    assert b"weberlink.master.devices.ros2.listener" in Path(f"/proc/{children[0]}/cmdline").read_bytes()
    return int(children[0])


def is_at(telemetry: Telemetry, place: Vector, within: float = 5e-4) -> bool:
    return distance(tuple(telemetry.last["output"]), place) < within


def test_robot_follows_a_node_of_another_make(tmp_path: Path) -> None:
    with led(tmp_path) as (program, master, slave, sdk):
        listener = listener_of(master.pid)
        assert os.sched_getscheduler(listener) == os.SCHED_OTHER, "it has no rights of the daemon"
        assert master.last["buttons"] == 0
        sdk.lead(FREE)
        until(lambda: is_at(slave, FREE), "the robot to come")
        assert master.last["buttons"] == 1
        sdk.lead(PRESSED)
        until(lambda: is_at(slave, (*PRESSED[:2], -DEPTH)), "the robot to reach the wall")
        until(lambda: abs(master.last["output"][2] / (DEPTH * WALL_N_M) - 1.0) < 0.15, "the wall to be felt")
        sdk.lead(None)
        until(lambda: not master.last["output"].any(), "the force to end")
        records = master.records
        last_held = records["at"][records["buttons"] == 1][-1]
        forces = np.linalg.norm(records["output"], axis=1)
        assert records["at"][forces > 0.0][-1] - last_held < 0.05 + 0.02, "faded"
        there = tuple(slave.last["output"])
        sdk.lead(FREE)
        until(lambda: is_at(slave, FREE), "the robot to be led again")
        assert there[2] < 1e-3
        sdk.kill()
        until(lambda: master.last["buttons"] == 0, "the hand to let go of a dead publisher")
        assert (master.last["state"], slave.last["state"]) == (ENGAGED, ENGAGED)
        program.send(signal.SIGINT)
        status, report, errors = program.finish()
    assert status == 0, report
    assert "weberlink ros2: /weberlink/target: nobody publishes it\n" in errors
    until(lambda: not Path(f"/proc/{listener}").exists(), "the listener to end")


@pytest.mark.hunt
def test_killed_listener_ends_the_session_with_its_reason(tmp_path: Path) -> None:
    with led(tmp_path) as (program, master, slave, sdk):
        sdk.lead(FREE)
        until(lambda: is_at(slave, FREE), "the robot to come")
        os.kill(listener_of(master.pid), signal.SIGKILL)
        killed = monotonic()
        status, report, _ = program.finish()
        assert status == 1
        assert "device fault: ros2: its listener was ended by SIGKILL; start the session again" in " ".join(
            report.split()
        )
        held = slave.records
        held = held["output"][held["at"] > killed + 0.3]
        assert (held == held[:1]).all(), "the robot stays"


@pytest.mark.hunt
def test_stopped_listener_is_the_hand_letting_go(tmp_path: Path) -> None:
    with led(tmp_path) as (_, master, slave, sdk):
        sdk.lead(FREE)
        until(lambda: is_at(slave, FREE), "the robot to come")
        listener = listener_of(master.pid)
        os.kill(listener, signal.SIGSTOP)
        stopped = monotonic()
        sdk.lead(HOME)
        until(lambda: master.last["buttons"] == 0, "the hand to let go")
        records = master.records
        assert records["at"][records["buttons"] == 1][-1] - stopped < SILENCE_S + 0.05
        os.kill(listener, signal.SIGCONT)
        until(lambda: is_at(slave, HOME), "the robot to be led again")
