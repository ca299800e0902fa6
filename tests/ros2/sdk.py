"""A process of zenoh-ros2-sdk (ROBOTIS, Apache-2.0) that lists topics, receives all of them, and may publish a pose.

    python -m tests.ros2.sdk PORT DOMAIN TOPICS [--pose]

It prints lines of JSON: first the topics with their types, then of each topic what it received by the end of its input.
The message definitions that it would clone from GitHub are written from those of rosbags; it computes their hashes
by its own code.
"""

import json
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread
from typing import Any

from zenoh_ros2_sdk import ROS2Publisher, ROS2Subscriber
from zenoh_ros2_sdk.discovery import get_topic_names_and_types
from zenoh_ros2_sdk.message_registry import get_registry
from zenoh_ros2_sdk.session import ZenohSession

from weberlink.ros2.messages import types

PACKAGES = (
    "builtin_interfaces",
    "std_msgs",
    "geometry_msgs",
    "tf2_msgs",
    "sensor_msgs",
    "diagnostic_msgs",
    "visualization_msgs",
)
POSE = "geometry_msgs/msg/PoseStamped"
TARGET = "/weberlink/target"
PATIENCE_S = 30.0


def write_definitions(folder: Path) -> None:
    for name in types().types:
        package, _, message = name.split("/")
        if package in PACKAGES:
            path = folder / package / "msg" / f"{message}.msg"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(types().generate_msgdef(name, ros_version=2)[0].partition("=" * 80)[0])


class Stream:
    """What is received of one topic: of each message the time, and the time in its header; and the newest message."""

    def __init__(self) -> None:
        self.received_ns: list[int] = []
        self.stamps_ns: list[int] = []
        self.newest: Any = None

    def take(self, message: Any, stamp: Any) -> None:
        self.received_ns.append(time.time_ns())
        self.stamps_ns.append(stamp.sec * 10**9 + stamp.nanosec)
        self.newest = message


class Streams(defaultdict[str, Stream]):
    """By topic; those of frames by the first frame of a message, as both sides publish them."""

    def taker(self, topic: str) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            if hasattr(message, "header"):
                self[topic].take(message, message.header.stamp)
            elif hasattr(message, "markers"):
                self[topic].take(message, message.markers[0].header.stamp)
            else:
                first = message.transforms[0]
                self[f"{topic} {first.child_frame_id}"].take(message, first.header.stamp)

        return take


def listed(port: int, domain: int, at_least: int) -> list[tuple[str, list[str]]]:
    """Topics with their types, as soon as there are so many."""
    give_up = time.monotonic() + PATIENCE_S
    while True:
        found: list[tuple[str, list[str]]] = get_topic_names_and_types(domain, router_port=port, timeout=0.5)
        if len(found) >= at_least or time.monotonic() > give_up:
            return found


def fields(value: Any) -> Any:
    """A message as JSON."""
    if hasattr(value, "__dataclass_fields__"):
        return {name: fields(getattr(value, name)) for name in value.__dataclass_fields__ if name != "__msgtype__"}
    if isinstance(value, list):
        return [fields(each) for each in value]
    return value.tolist() if hasattr(value, "tolist") else value


def say(document: Any) -> None:
    sys.stdout.write(json.dumps(document) + "\n")
    sys.stdout.flush()


def publish_pose(port: int, domain: int) -> None:
    """Publish a rising pose at 100 Hz until the process ends."""
    publisher = ROS2Publisher(TARGET, POSE, domain_id=domain, router_port=port)
    classes = {name: types().types[name] for name in types().types if name.split("/")[0] in PACKAGES}
    count = 0
    while True:
        count += 1
        now = time.time_ns()
        stamp = classes["builtin_interfaces/msg/Time"](now // 10**9, now % 10**9)
        point = classes["geometry_msgs/msg/Point"](1e-3 * count, 0.0, 0.0)
        turn = classes["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
        publisher.publish(
            header=classes["std_msgs/msg/Header"](stamp, "weberlink"),
            pose=classes["geometry_msgs/msg/Pose"](point, turn),
        )
        time.sleep(0.01)


def main(port: int, domain: int, at_least: int, *, pose: bool) -> None:
    with TemporaryDirectory() as folder:
        write_definitions(Path(folder))
        get_registry(folder)
        ZenohSession.get_instance(router_port=port)
        if pose:
            Thread(target=publish_pose, args=(port, domain), daemon=True).start()
        topics = listed(port, domain, at_least)
        streams = Streams(Stream)
        subscribers = [
            ROS2Subscriber(name, kinds[0], streams.taker(name), domain_id=domain, router_port=port)
            for name, kinds in topics
        ]
        say(dict(topics))
        sys.stdin.read()
        for subscriber in subscribers:
            subscriber.close()
        ZenohSession.get_instance().close()
    say(
        {
            name: {"received_ns": each.received_ns, "stamps_ns": each.stamps_ns, "newest": fields(each.newest)}
            for name, each in streams.items()
        }
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:4]), pose="--pose" in sys.argv[4:])
