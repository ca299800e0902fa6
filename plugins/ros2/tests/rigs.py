"""Zenoh endpoints, nodes that publish poses and a listener that hears them, and rings of sides."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import cos, sin
from pathlib import Path
from socket import socket
from threading import Event, Thread
from time import time_ns
from typing import Any

from plugins.figures.tests.sources import description
from weberlink.session.description import Description
from weberlink.telemetry.ring import RingWriter
from weberlink.testing.time import until
from weberlink_ros2.admission import Subscription
from weberlink_ros2.messages import encode_body, types
from weberlink_ros2.node import Node, Publisher
from weberlink_ros2.process import ListenerProcess

TYPE = "geometry_msgs/msg/PoseStamped"
TOPIC = "/weberlink/target"


def endpoint() -> str:
    """On loopback; the first node that opens it takes the place of the router."""
    with socket() as free:
        free.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{free.getsockname()[1]}"


def ring(folder: Path, side: str, session: int = 7, described: Any = None) -> RingWriter:
    path = folder / f"weberlink-{session}-{side}.ring"
    Description(path, described or description(side)).publish()
    return RingWriter(path, side=side, rate_hz=1000.0, capacity=4096)


def body(x: float, stamp_ns: int, frame: str = "weberlink", type_name: str = TYPE, turned_rad: float = 0.0) -> bytes:
    """A message without its encapsulation header, at (x, 0, 0.03) and turned about z."""

    def make(name: str, *values: Any) -> Any:
        return types().types[name](*values)

    turn = make("geometry_msgs/msg/Quaternion", 0.0, 0.0, sin(0.5 * turned_rad), cos(0.5 * turned_rad))
    pose = make("geometry_msgs/msg/Pose", make("geometry_msgs/msg/Point", x, 0.0, 0.03), turn)
    if type_name != TYPE:
        return encode_body(pose, type_name)
    time = make("builtin_interfaces/msg/Time", stamp_ns // 10**9, stamp_ns % 10**9)
    return encode_body(make(TYPE, make("std_msgs/msg/Header", time, frame), pose), TYPE)


@contextmanager
def steadily(publisher: Publisher, x: float, **other: Any) -> Iterator[None]:
    ended = Event()

    def publish() -> None:
        while not ended.wait(0.01):
            now = time_ns()
            publisher.put_body(body(x, now, **other), now)

    thread = Thread(target=publish)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@contextmanager
def publishing(router: str, type_name: str = TYPE) -> Iterator[Publisher]:
    with Node("leader", 0, router) as node:
        yield node.publisher(TOPIC, type_name)


@contextmanager
def listening(router: str, **other: Any) -> Iterator[ListenerProcess]:
    wanted = Subscription(TOPIC, 0, router, "weberlink", (0.0, 0.0, 0.0), 0.1, turns=False)._replace(**other)
    process = ListenerProcess(wanted)
    process.open()
    process.lead(allowed=True)
    try:
        yield process
    finally:
        process.close()


def await_trouble(process: ListenerProcess, part: str | None) -> None:
    def is_told() -> bool:
        process.newest()
        return process.trouble is None if part is None else part in (process.trouble or "")

    until(is_told, f"{part!r}")
