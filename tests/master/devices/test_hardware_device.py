"""What is alike for all devices that block: limits, and the name in front of a fault."""

from collections.abc import Iterator
from contextlib import closing
from time import monotonic
from typing import Any

import pytest

from weberlink.geometry.vector import ZERO, Vector
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.master.devices.contract import DeviceReading, DeviceSpec
from weberlink.master.devices.hardware_device import ThreadedDevice
from weberlink.testing.devices import drive, fault_of, refusal

TICK = 0.001
BOX = ((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1))


class Exchange:
    """Takes down the last command; `trouble` is raised at the next exchanges."""

    def __init__(self) -> None:
        self.told: Any = None
        self.trouble: HardwareFault | None = None
        self.closed = 0

    def open(self) -> DeviceReading:
        if self.trouble is not None:
            raise self.trouble
        return DeviceReading(monotonic(), ZERO)

    def exchange(self, command: Any) -> DeviceReading:
        self.told = command
        return self.open()

    def close(self) -> None:
        self.closed += 1


@pytest.fixture
def exchange() -> Exchange:
    return Exchange()


@pytest.fixture
def device(exchange: Exchange) -> Iterator[Any]:
    spec = DeviceSpec("thing", "xz", 3.0, 500.0, BOX, 1.0 / TICK, force_feedback=True)
    with closing(ThreadedDevice(spec, exchange, TICK)) as made:
        made.open(0.0)
        yield made


@pytest.mark.parametrize(
    ("force", "told"),
    [
        ((0.3, 0.0, -0.4), (0.3, 0.0, -0.4)),
        ((30.0, 0.0, -40.0), (1.8, 0.0, -2.4)),
        ((0.3, 100.0, -0.4), (0.3, 0.0, -0.4)),  # what it cannot display takes away nothing
    ],
)
def test_limited_force_keeps_direction_within_axes(
    exchange: Exchange, device: Any, force: Vector, told: Vector
) -> None:
    drive(device, lambda: exchange.told == pytest.approx(told), force)
    drive(device, lambda: exchange.told == ZERO, ZERO)


@pytest.mark.parametrize("said", ["unplugged", "thing: unplugged"])
@pytest.mark.parametrize("kind", [HardwareFault, BadReply])
def test_a_fault_has_the_name_in_front_once(exchange: Exchange, device: Any, kind: Any, said: str) -> None:
    exchange.trouble = kind(said)
    assert fault_of(device) == "thing: unplugged"
    assert exchange.closed > 0
    assert refusal(device) == "thing: unplugged"
    exchange.trouble = None
    device.open(0.0)
    assert device.latest(0.0).at <= monotonic()
