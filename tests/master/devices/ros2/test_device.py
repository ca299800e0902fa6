"""The `ros2` driver with poses that a test hands it, and its options."""

from typing import Any

import pytest

from tests.master.devices.benches import Poses
from weberlink.geometry.vector import distance
from weberlink.master.devices.contract import DeviceFault, ReportsTrouble
from weberlink.master.devices.ros2.device import Ros2Device
from weberlink.master.devices.ros2.options import Ros2Options
from weberlink.system.configuration import ConfigurationError
from weberlink.system.configuration.extras import need
from weberlink.testing.time import TICK

LEFT = (-0.05, 0.0, 0.03)


def opened(poses: Poses, **options: Any) -> Ros2Device:
    device = Ros2Device(Ros2Options(**options), TICK, poses)
    device.open(10.0)
    return device


def test_hand_follows_poses_and_is_held_while_they_come() -> None:
    device = opened(Poses(lambda time: (LEFT, True) if time < 1.0 else None))
    seen = [device.latest(10.0 + (tick + 1) * TICK) for tick in range(1500)]
    assert distance(seen[999].position, LEFT) < 1e-4
    assert (seen[999].buttons, seen[1050].buttons, seen[1150].buttons) == (1, 1, 0)


def test_trouble_of_the_listener_is_that_of_the_device() -> None:
    poses = Poses(lambda _: None)
    device = opened(poses)
    assert isinstance(device, ReportsTrouble)
    assert device.trouble is None
    poses.trouble = "/weberlink/target: nobody publishes it"
    assert device.trouble == poses.trouble
    device.latest(10.001)


def test_dead_listener_is_a_fault_with_its_reason() -> None:
    poses = Poses(lambda _: (LEFT, True))
    device = opened(poses)
    device.latest(10.001)
    poses.failure = "its listener was ended by SIGKILL; start the session again"
    with pytest.raises(DeviceFault, match="ros2: its listener was ended by SIGKILL"):
        device.latest(10.002)


def test_missing_zenoh_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("weberlink.system.configuration.extras.find_spec", lambda _name: None)
    package, extra = Ros2Device.NEEDS
    with pytest.raises(ConfigurationError, match=r"install it with: .*\[ros2\]"):
        need(package, extra, "master.device.driver: ros2")
