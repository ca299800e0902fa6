"""A session on the topics of `bridge ros2`, listed and received by zenoh-ros2-sdk, which others wrote."""

import json
import subprocess
import sys
import time
from pathlib import Path
from threading import Timer

import numpy as np
import pytest

from plugins.ros2.tests.rigs import endpoint, ring
from tests.watching.sources import records as engaged
from tests.watching.sources import write
from weberlink_ros2.bridge import Ros2Bridge
from weberlink_ros2.follow import SessionFollower
from weberlink_ros2.names import Qos
from weberlink_ros2.node import Node

POSE, WRENCH = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped"
MARKERS = "visualization_msgs/msg/MarkerArray"
LISTED = {
    "/diagnostics": ["diagnostic_msgs/msg/DiagnosticArray"],
    "/tf": ["tf2_msgs/msg/TFMessage"],
    "/weberlink/bodies": [MARKERS],
    "/weberlink/felt": [WRENCH],
    "/weberlink/hand": [POSE],
    "/weberlink/measured": [WRENCH],
    "/weberlink/robot": [POSE],
    "/weberlink/scene": [MARKERS],
}
DOMAIN, TICKS = 5, 200
LIMIT_S = 120.0  # until the client of others is ended


@pytest.mark.realtime
def test_a_client_of_others_lists_and_receives(tmp_path: Path) -> None:
    pytest.importorskip("zenoh_ros2_sdk", exc_type=ImportError)
    where = endpoint()
    bridge = Ros2Bridge(Node("weberlink", DOMAIN, where), Qos(), None, print)
    follower = SessionFollower(bridge, None, print, tmp_path)
    numbers = map(str, (where.rpartition(":")[2], DOMAIN, len(LISTED), TICKS))
    command = [sys.executable, "-m", "plugins.ros2.tests.sdk", *numbers]
    rings = {side: ring(tmp_path, side) for side in ("master", "slave")}
    follower.look(0.0)
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as sdk:
        timer = Timer(LIMIT_S, sdk.kill)  # which ends a line that does not come
        timer.start()
        assert sdk.stdout is not None
        listed = sdk.stdout.readline()
        timer.cancel()
        assert listed, "the client lists nothing"
        assert json.loads(listed) == LISTED
        made = engaged(TICKS, seed=1)
        made["at"] = time.monotonic() + 1e-3 * np.arange(TICKS)
        for first in range(0, TICKS, 4):
            for writer in rings.values():
                write(writer, made[first : first + 4])
            follower.look(1.0 + first)
            time.sleep(0.002)
        output, _ = sdk.communicate(timeout=LIMIT_S)
    follower.close()
    bridge.close()
    for writer in rings.values():
        writer.close()
    received, last = json.loads(output), made[-1]
    for name in ("hand", "felt", "robot", "measured"):
        assert len(received[f"/weberlink/{name}"]) == TICKS
    newest = {name.rpartition("/")[2]: messages[-1] for name, messages in received.items()}
    for name, field in (("hand", "position"), ("robot", "output")):
        assert list(newest[name]["pose"]["position"].values()) == last[field].tolist()
    for name, field in (("felt", "output"), ("measured", "raw")):
        assert list(newest[name]["wrench"]["force"].values()) == last[field].tolist()
    assert len(newest["scene"]["markers"]) == 2  # of configs/loopback.yaml
    assert {each["transforms"][0]["child_frame_id"] for each in received["/tf"]} >= {"robot"}
