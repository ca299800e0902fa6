"""The listener process against nodes of Zenoh: what leads, what is told, and how either end ends."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from time import monotonic, sleep

import pytest

from plugins.ros2.tests.rigs import await_trouble, endpoint, listening, publishing, steadily
from tests.program import ENGAGED, PATIENT, Program, weberlink
from weberlink.master.devices.contract import DeviceFault
from weberlink.testing.time import TICK, running_time, until
from weberlink_ros2.device import Ros2Device, Ros2Options
from weberlink_ros2.node import Node

pytestmark = pytest.mark.realtime
FILE = Path(__file__).parents[1] / "configs" / "ros2.yaml"


@pytest.fixture
def router() -> str:
    return endpoint()


def test_poses_lead_and_what_is_wrong_is_told(router: str) -> None:
    with listening(router, turns=True, silence=1.0) as process:
        await_trouble(process, "/weberlink/target: nobody publishes it")
        with publishing(router) as publisher:
            await_trouble(process, "no pose comes")
            with steadily(publisher, 0.01, turned_rad=0.5):
                target = until(process.newest, "a pose", pause=1e-3)
                assert (target.target, target.held) == ((0.01, 0.0, 0.03), True)
                assert target.rotation == pytest.approx((0.0, 0.0, 0.5))
                await_trouble(process, None)
            with steadily(publisher, 0.02, frame="map"):
                await_trouble(process, "its frame_id is 'map', not 'weberlink'")
                sleep(0.1)
                assert process.newest() is None
            with steadily(publisher, float("nan")):
                await_trouble(process, "its position is not finite: nan, 0, 0.03")
            process.lead(allowed=False)
            process.lead(allowed=True)
            with steadily(publisher, 0.03):
                assert until(process.newest, "a pose", pause=1e-3).target == (0.03, 0.0, 0.03)
        with publishing(router, type_name="geometry_msgs/msg/Pose") as wrong:
            with steadily(wrong, 0.04, type_name="geometry_msgs/msg/Pose"):
                await_trouble(process, "published as geometry_msgs/msg/Pose, not as geometry_msgs/msg/PoseStamped")
            assert process.failure is None


def test_poses_lead_a_session_only_while_its_user_lets_them(router: str) -> None:
    """Nothing but the command holds the hand; killed, it lets go."""
    connect = ("--set", f"master.device.connect={router}")
    with Program("loopback", FILE, *connect, *PATIENT) as loopback, publishing(router) as publisher:
        hand = loopback.telemetry("master")
        with steadily(publisher, 0.03):
            until(lambda: hand.last["state"] == ENGAGED, "the session")
            sleep(0.5)
            assert not hand.records["buttons"].any()
            with Program("lead", "--session", loopback.pid) as lead:
                until(lambda: hand.last["buttons"] == 1, "the hand to be held")
                until(lambda: hand.last["position"][0] > 0.02, "the hand to be led")
                lead.send(signal.SIGKILL)
                until(lambda: hand.last["buttons"] == 0, "the hand to be let go")
            sleep(0.5)
            assert hand.last["buttons"] == 0


def test_without_a_session_there_is_nothing_to_lead() -> None:
    assert "lead: " in weberlink("lead", "--session", "1").complaint(1)


def test_killed_listener_is_a_fault_at_once(router: str) -> None:
    device = Ros2Device(Ros2Options(connect=router), TICK)
    device.open(monotonic())
    try:
        device.latest(monotonic())
        os.kill(device._poses.pid, signal.SIGKILL)  # type: ignore[attr-defined]
        told = "ros2: its listener was killed by SIGKILL; start the session again"
        with running_time() as ran, pytest.raises(DeviceFault, match=told):
            until(lambda: device.latest(monotonic()) is None, "a fault", pause=TICK)
        assert ran() < 1.0
    finally:
        device.close()


DAEMON = """
import sys, time
from weberlink_ros2.device import Ros2Device, Ros2Options
device = Ros2Device(Ros2Options(connect=sys.argv[1]), 1e-3)
device.open(time.monotonic())
print(device._poses.pid, "zenoh" in sys.modules, "rosbags" in sys.modules, flush=True)
time.sleep(60)
"""


def test_listener_ends_with_a_killed_daemon_that_imports_no_zenoh(router: str) -> None:
    with subprocess.Popen([sys.executable, "-c", DAEMON, router], stdout=subprocess.PIPE, text=True) as daemon:
        assert daemon.stdout is not None
        pid, *imported = daemon.stdout.readline().split()
        assert imported == ["False", "False"]
        daemon.kill()
        until(lambda: not _runs(pid), "the end of the listener")
    with Node("next", 0, router) as node:
        assert node.is_router, "its place is free"


def _runs(pid: str) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
