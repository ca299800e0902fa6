"""A process of zenoh-ros2-sdk (ROBOTIS, Apache-2.0) that lists topics and receives all of them.

    python -m plugins.ros2.tests.sdk PORT DOMAIN TOPICS TICKS

It prints lines of JSON: first the topics with their types, then "receives" once every topic of each tick has brought
something, then the messages of each topic by the end of its input.
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
from typing import Any

from zenoh_ros2_sdk import ROS2Subscriber
from zenoh_ros2_sdk.discovery import get_topic_names_and_types
from zenoh_ros2_sdk.message_registry import get_registry
from zenoh_ros2_sdk.session import ZenohSession

from weberlink_ros2.messages import types

PACKAGES = {f"{name}_msgs" for name in ("std", "geometry", "tf2", "sensor", "diagnostic", "visualization")} | {
    "builtin_interfaces"
}
PATIENCE_S = 30.0


def write_definitions(folder: Path) -> None:
    for name in types().types:
        package, _, message = name.split("/")
        if package in PACKAGES:
            path = folder / package / "msg" / f"{message}.msg"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(types().generate_msgdef(name, ros_version=2)[0].partition("=" * 80)[0])


def listed(port: int, domain: int, at_least: int) -> list[tuple[str, list[str]]]:
    """Topics with their types, as soon as there are so many."""
    give_up = time.monotonic() + PATIENCE_S
    while True:
        found: list[tuple[str, list[str]]] = get_topic_names_and_types(domain, router_port=port, timeout=0.5)
        if len(found) >= at_least or time.monotonic() > give_up:
            return found


def wait_for(condition: Callable[[], bool]) -> None:
    give_up = time.monotonic() + PATIENCE_S
    while not condition() and time.monotonic() < give_up:
        time.sleep(0.01)


def fields(value: Any) -> Any:
    if hasattr(value, "__dataclass_fields__"):
        return {name: fields(getattr(value, name)) for name in value.__dataclass_fields__ if name != "__msgtype__"}
    if isinstance(value, list):
        return [fields(each) for each in value]
    return value.tolist() if hasattr(value, "tolist") else value


def say(document: Any) -> None:
    sys.stdout.write(json.dumps(document) + "\n")
    sys.stdout.flush()


def main(port: int, domain: int, at_least: int, ticks: int) -> None:
    received: dict[str, list[Any]] = defaultdict(list)
    with TemporaryDirectory() as folder:
        write_definitions(Path(folder))
        get_registry(folder)
        ZenohSession.get_instance(router_port=port)
        topics = listed(port, domain, at_least)
        subscribers = [
            ROS2Subscriber(name, kinds[0], received[name].append, domain_id=domain, router_port=port)
            for name, kinds in topics
        ]
        say(dict(topics))
        every_tick = [received[name] for name, kinds in topics if kinds[0].endswith("Stamped")]
        wait_for(lambda: min(map(len, every_tick)) > 0)
        say("receives")
        sys.stdin.read()
        wait_for(lambda: min(map(len, every_tick)) > ticks)
        time.sleep(1.0)  # what came before the input ended may be among them
        for subscriber in subscribers:
            subscriber.close()
        ZenohSession.get_instance().close()
    say({name: [fields(each) for each in messages] for name, messages in received.items()})


if __name__ == "__main__":
    main(*map(int, sys.argv[1:5]))
