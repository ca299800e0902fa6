"""A session on the topics of `bridge ros2`, listed and received by zenoh-ros2-sdk, which others wrote."""

import json
import subprocess
import sys
import time
from pathlib import Path
from select import select
from threading import Timer

import numpy as np
import pytest

from plugins.figures.tests.sources import records as engaged, write
from plugins.ros2.tests.rigs import endpoint, ring
from weberlink.telemetry.reader import Records
from weberlink.telemetry.record import FORCE
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

    def publish(made: Records) -> None:
        made["at"] = time.monotonic() + 1e-3 * np.arange(len(made))
        for writer in rings.values():
            write(writer, made)
        follower.look(1.0 + made["tick"][0])

    follower.look(0.0)
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as sdk:
        timer = Timer(LIMIT_S, sdk.kill)  # which ends a line that does not come
        timer.start()
        assert sdk.stdout is not None
        listed = sdk.stdout.readline()
        assert listed, "the client lists nothing"
        assert json.loads(listed) == LISTED
        first = 0
        while not select((sdk.stdout,), (), (), 0.02)[0]:  # its subscriptions arrive after it has made them
            publish(engaged(4, first=first, seed=0))
            first += 4
        timer.cancel()
        assert json.loads(sdk.stdout.readline()) == "receives"
        made = engaged(TICKS, first=first, seed=1)
        for batch in range(0, TICKS, 4):
            publish(made[batch : batch + 4])
            time.sleep(0.002)
        output, _ = sdk.communicate(timeout=LIMIT_S)
    follower.close()
    bridge.close()
    for writer in rings.values():
        writer.close()
    received = json.loads(output)
    every = {"hand": "position", "robot": "output", "felt": "output", "measured": "raw"}
    for name, field in every.items():
        messages = received[f"/weberlink/{name}"][-TICKS:]
        place = [m["pose"]["position"] if "pose" in m else m["wrench"]["force"] for m in messages]
        assert [list(each.values()) for each in place] == made[field][:, FORCE].tolist()
    newest = {name.rpartition("/")[2]: messages[-1] for name, messages in received.items()}
    assert len(newest["scene"]["markers"]) == 2  # of configs/loopback.yaml
    assert {each["transforms"][0]["child_frame_id"] for each in received["/tf"]} >= {"robot"}
