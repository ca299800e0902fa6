"""The device keeps the contract of devices, before poses that come as its listener hands them on."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import sin
from pathlib import Path
from typing import Any

import pytest

from plugins.pointer.tests.targets import Targets
from weberlink.geometry.vector import ZERO, Vector
from weberlink.testing.devices import DeviceBench, DeviceContract
from weberlink.testing.time import TICK, virtual_time
from weberlink_pointer.target_link import PointerTarget
from weberlink_ros2.device import Ros2Device, Ros2Options


class Poses(Targets):
    trouble: str | None = None
    failure: str | None = None
    allowed = False

    def lead(self, *, allowed: bool) -> None:
        self.allowed = allowed

    def newest(self) -> PointerTarget | None:
        newest = super().newest()
        return newest if self.allowed else None


class TestRos2(DeviceContract):
    NAME = "ros2"
    REFUSED = (({"topic": "target"}, "topic"), ({"connect": "192.168.1.5:7447"}, "a Zenoh endpoint is like tcp/"))
    TAKEN = ({"topic": "/a/b_1", "connect": "tcp/192.168.1.5:7447"},)

    @contextmanager
    def make_bench(self, folder: Path, /, **options: Any) -> Iterator[DeviceBench]:
        swing = Poses(lambda time: ((0.05 * sin(3.0 * time), 0.0, 0.02), True))
        yield DeviceBench(Ros2Device(Ros2Options(**options), TICK, swing, held()), virtual_time())


def held() -> Targets:
    return Targets(lambda _time: (ZERO, True))


def test_the_hand_is_held_only_while_somebody_lets_the_topic_lead() -> None:
    """Poses come all the time; the act lasts from 0.2 to 0.6 s, and another one that ends in silence from 0.8 s."""

    def act(time: float) -> tuple[Vector, bool] | None:
        return (ZERO, 0.2 <= time < 0.6 or time >= 0.8) if time < 1.0 else None

    poses, hold = Poses(lambda _time: ((0.05, 0.0, 0.02), True)), Targets(act)
    device = Ros2Device(Ros2Options(), TICK, poses, hold)
    device.open(0.0)
    pressed = [bool(device.latest((number + 1) * TICK).buttons) for number in range(1500)]
    device.close()
    changes = [number for number in range(1, 1500) if pressed[number] is not pressed[number - 1]]
    assert changes == pytest.approx([200, 600, 800, 1200], abs=40)
    assert (poses.opened, hold.opened) == (0, 0)
