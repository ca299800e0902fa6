"""Nodes of a test that publish poses, and a listener process that hears them."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import cos, sin
from threading import Event, Thread
from time import monotonic, sleep, time_ns
from typing import Any

import pytest

from weberlink.master.devices.pointer_link import PointerTarget
from weberlink_ros2.admission import Subscription
from weberlink_ros2.messages import encode_body, types
from weberlink_ros2.node import Node, Publisher
from weberlink_ros2.process import ListenerProcess

TYPE = "geometry_msgs/msg/PoseStamped"
TOPIC = "/weberlink/target"
PATIENCE = 30.0
"""Until a test gives up [s]; says nothing about how fast anything has to be."""


def body(x: float, stamp_ns: int, frame: str = "weberlink", type_name: str = TYPE, turned_rad: float = 0.0) -> bytes:
    """A message without its encapsulation header, at (x, 0, 0.03) and turned about z."""
    store = types()

    def make(name: str, *values: Any) -> Any:
        return store.types[name](*values)

    pose = make(
        "geometry_msgs/msg/Pose",
        make("geometry_msgs/msg/Point", x, 0.0, 0.03),
        make("geometry_msgs/msg/Quaternion", 0.0, 0.0, sin(0.5 * turned_rad), cos(0.5 * turned_rad)),
    )
    if type_name != TYPE:
        return encode_body(pose, type_name)
    time = make("builtin_interfaces/msg/Time", stamp_ns // 10**9, stamp_ns % 10**9)
    stamped = make(TYPE, make("std_msgs/msg/Header", time, frame), pose)
    return encode_body(stamped, TYPE)


@contextmanager
def steadily(publisher: Publisher, x: float, rate_hz: float = 100.0, **other: Any) -> Iterator[None]:
    """Publish a pose at a rate during the block."""
    ended = Event()

    def publish() -> None:
        while not ended.wait(1.0 / rate_hz):
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
def publishing(router: str, name: str = "leader", topic: str = TOPIC, type_name: str = TYPE) -> Iterator[Publisher]:
    """A publisher of a node of its own."""
    with Node(name, 0, router) as node:
        yield node.publisher(topic, type_name)


@contextmanager
def listening(router: str, **other: Any) -> Iterator[ListenerProcess]:
    wanted = Subscription(TOPIC, 0, router, "weberlink", (0.0, 0.0, 0.0), 0.1, turns=False)._replace(**other)
    process = ListenerProcess(wanted)
    process.open()
    try:
        yield process
    finally:
        process.close()


def next_target(process: ListenerProcess) -> PointerTarget:
    """The next target that comes."""
    until = monotonic() + PATIENCE
    while (target := process.newest()) is None:
        if monotonic() > until:
            pytest.fail(f"no target came in {PATIENCE:g} s; trouble: {process.trouble}, failure: {process.failure}")
        sleep(1e-3)
    return target


def await_trouble(process: ListenerProcess, part: str | None) -> None:
    """Wait until the trouble has a part, or there is none."""
    until = monotonic() + PATIENCE
    while not (process.trouble is None if part is None else part in (process.trouble or "")):
        if monotonic() > until:
            pytest.fail(f"waited for {part!r}; trouble: {process.trouble!r}, failure: {process.failure!r}")
        process.newest()
        sleep(0.01)
