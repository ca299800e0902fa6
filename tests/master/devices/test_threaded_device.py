"""What is alike for all devices that block: limits, faults, and the same answer for the same time."""

from collections.abc import Iterator
from time import monotonic, sleep

import pytest

from weberlink.geometry.vector import Vector, norm
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.master.devices.contract import DeviceFault, DeviceReading, DeviceSpec
from weberlink.master.devices.threaded_device import (
    NO_WRENCH,
    ThreadedDevice,
    ThreadedTorqueDevice,
    Wrench,
)

PATIENCE = 30.0
TICK = 0.001
BOX = ((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1))


class Exchange:
    """Takes down what it is told; `trouble` is raised at the next exchanges."""

    def __init__(self) -> None:
        self.told: list[Vector] = []
        self.told_at: list[float] = []
        self.trouble: HardwareFault | None = None
        self.trouble_left = -1
        self.closed = 0

    def open(self) -> DeviceReading:
        return self.exchange((0.0, 0.0, 0.0))

    def exchange(self, command: Vector) -> DeviceReading:
        if self.trouble is not None and self.trouble_left != 0:
            self.trouble_left -= 1
            raise self.trouble
        self.told_at.append(monotonic())
        self.told.append(command)
        return DeviceReading(monotonic(), (1e-6 * len(self.told), 0.0, 0.0))

    def close(self) -> None:
        self.closed += 1


@pytest.fixture
def exchange() -> Exchange:
    return Exchange()


@pytest.fixture
def device(exchange: Exchange) -> Iterator[ThreadedDevice]:
    spec = DeviceSpec("thing", "xz", 3.0, 500.0, BOX, 1.0 / TICK, force_feedback=True)
    device = ThreadedDevice(spec, exchange, TICK)
    yield device
    device.close()


def told(device: ThreadedDevice, exchange: Exchange, force: Vector) -> Vector:
    """What the exchange is told when this is commanded, once the force has come up."""
    gives_up = monotonic() + PATIENCE
    exchange.told.clear()
    while not has_come_up(exchange.told):
        assert monotonic() < gives_up
        device.command(force, monotonic())
        sleep(TICK)
    return exchange.told[-1]


def has_come_up(told: list[Vector]) -> bool:
    return len(told) > 10 and norm(told[-1]) > 0.0 and told[-1] == told[-10]


def test_limited_force_keeps_direction_within_axes(device: ThreadedDevice, exchange: Exchange) -> None:
    device.open(0.0)
    assert told(device, exchange, (0.3, 0.0, -0.4)) == (0.3, 0.0, -0.4)
    assert told(device, exchange, (30.0, 0.0, -40.0)) == pytest.approx((1.8, 0.0, -2.4))
    assert told(device, exchange, (0.3, 100.0, -0.4)) == (0.3, 0.0, -0.4), "what it cannot display takes away nothing"


@pytest.mark.parametrize("said", ["unplugged", "thing: unplugged"])
@pytest.mark.parametrize("kind", [HardwareFault, BadReply])
def test_a_fault_has_the_name_in_front_once(
    kind: type[HardwareFault], said: str, device: ThreadedDevice, exchange: Exchange
) -> None:
    device.open(0.0)
    exchange.trouble = kind(said)
    gives_up = monotonic() + PATIENCE
    with pytest.raises(DeviceFault) as caught:
        while monotonic() < gives_up:
            device.latest(monotonic())
            sleep(TICK)
    assert str(caught.value) == "thing: unplugged"
    assert exchange.closed > 0
    with pytest.raises(DeviceFault, match=r"^thing: unplugged$"):
        device.open(0.0)
    exchange.trouble = None
    device.open(0.0)
    assert device.latest(0.0).at <= monotonic()


class WrenchExchange:
    """Takes down the last wrench that it is told."""

    def __init__(self) -> None:
        self.told = NO_WRENCH

    def open(self) -> DeviceReading:
        return DeviceReading(monotonic(), (0.0, 0.0, 0.0))

    def exchange(self, command: Wrench) -> DeviceReading:
        self.told = command
        return self.open()

    def close(self) -> None: ...


def test_torque_goes_with_the_force_within_limit_until_stale() -> None:
    spec = DeviceSpec(
        "thing", "xyz", 3.0, 500.0, BOX, 1.0 / TICK, force_feedback=True, orientation=True, torque_n_m=0.2
    )
    exchange = WrenchExchange()
    device = ThreadedTorqueDevice(spec, exchange, TICK)
    device.turn((0.1, 0.0, 0.0), monotonic())
    device.open(monotonic())
    try:
        gives_up = monotonic() + PATIENCE
        while exchange.told != ((1.0, 0.0, 0.0), (0.0, 0.2, 0.0)):
            assert monotonic() < gives_up
            assert exchange.told.torque[0] == 0.0, "what was said before it was opened has no effect"
            device.command((1.0, 0.0, 0.0), monotonic())
            device.turn((0.0, 7.0, 0.0), monotonic())
            sleep(TICK)
        while exchange.told != ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0)):
            assert monotonic() < gives_up
            device.command((1.0, 0.0, 0.0), monotonic())
            sleep(TICK)
    finally:
        device.close()
