"""The device keeps the contract of devices, before poses that come as its listener hands them on."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import sin
from pathlib import Path
from typing import Any

from tests.master.devices.targets import Targets
from weberlink.testing.devices import DeviceBench, DeviceContract
from weberlink.testing.time import TICK, virtual_time
from weberlink_ros2.device import Ros2Device, Ros2Options


class Poses(Targets):
    """Poses of a topic as its listener hands them on."""

    trouble: str | None = None
    failure: str | None = None


class TestRos2(DeviceContract):
    NAME = "ros2"
    REFUSED = (
        ({"topic": "target"}, "topic"),
        ({"connect": "192.168.1.5:7447"}, "a Zenoh endpoint is like tcp/"),
    )
    TAKEN = ({"topic": "/a/b_1", "connect": "tcp/192.168.1.5:7447"},)

    @contextmanager
    def make_bench(self, folder: Path, /, **options: Any) -> Iterator[DeviceBench]:
        swing = Poses(lambda time: ((0.05 * sin(3.0 * time), 0.0, 0.02), True))
        yield DeviceBench(Ros2Device(Ros2Options(**options), TICK, swing), virtual_time())
