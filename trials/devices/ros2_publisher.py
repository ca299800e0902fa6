"""A node of a third party that publishes poses: zenoh-ros2-sdk, which shares no code with this project.

    python -m trials.devices.ros2_publisher FOLDER PORT RATE_HZ

It reads lines "x y z" [m] on standard input and publishes the newest at a rate; an empty line pauses it, and with
"clock" x is the number of the pose and y the time of `monotonic` [s]. It ends with its input. Its first line of output
is the key under which it publishes, with the hash that it computes itself.
"""

import sys
from pathlib import Path
from threading import Thread
from time import monotonic, sleep, time_ns
from typing import Any

from zenoh_ros2_sdk import ROS2Publisher, ZenohSession, get_registry

from plugins.ros2.tests.sdk import write_definitions

TYPE = "geometry_msgs/msg/PoseStamped"


class Lines:
    """The newest line of standard input."""

    def __init__(self) -> None:
        self.newest = ""
        self.number = 0
        self.ended = False

    def read(self) -> None:
        for line in sys.stdin:
            self.newest = line.strip()
        self.ended = True

    @property
    def target(self) -> tuple[float, ...]:
        if self.newest != "clock":
            return tuple(map(float, self.newest.split()))
        self.number += 1
        return float(self.number), monotonic(), 0.0


def main(folder: Path, port: int, rate_hz: float) -> None:
    write_definitions(folder)
    session: Any = ZenohSession.get_instance("127.0.0.1", port)
    get_registry().messages_dir = folder
    publisher = ROS2Publisher("/weberlink/target", TYPE)
    types = session.store.types
    sys.stdout.write(f"{publisher.keyexpr}\n")
    sys.stdout.flush()
    lines = Lines()
    Thread(target=lines.read, daemon=True).start()
    due = monotonic()
    while not lines.ended:
        if target := lines.target:
            now = time_ns()
            stamp = types["builtin_interfaces/msg/Time"](now // 10**9, now % 10**9)
            point = types["geometry_msgs/msg/Point"](*target)
            level = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
            publisher.publish(
                header=types["std_msgs/msg/Header"](stamp, "weberlink"),
                pose=types["geometry_msgs/msg/Pose"](point, level),
            )
        due = max(monotonic(), due + 1.0 / rate_hz)
        sleep(max(0.0, due - monotonic()))
    publisher.close()
    session.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]))
