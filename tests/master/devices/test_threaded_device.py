"""What is alike for all devices that block: limits, faults, and the same answer for the same time."""

from collections.abc import Iterator
from time import monotonic, sleep

import pytest

from codec.vector import Vector, norm
from hardware.fault import BadReply, HardwareFault
from master.devices.contract import DeviceFault, DeviceReading, DeviceSpec
from master.devices.threaded_device import ThreadedDevice

PATIENCE = 30.0
TICK = 0.001
BOX = ((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1))


class Exchange:
    """Takes down what it is told; `trouble` is raised at the next exchanges."""

    def __init__(self) -> None:
        self.told: list[Vector] = []
        self.trouble: HardwareFault | None = None
        self.closed = 0

    def open(self) -> DeviceReading:
        return self.exchange((0.0, 0.0, 0.0))

    def exchange(self, command: Vector) -> DeviceReading:
        if self.trouble is not None:
            raise self.trouble
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
    """What the exchange is told when this is commanded."""
    exchange.told.clear()
    gives_up = monotonic() + PATIENCE
    while not (forces := [each for each in exchange.told if norm(each) > 0.0]):
        assert monotonic() < gives_up
        device.command(force, monotonic())
        sleep(TICK)
    return forces[0]


def test_a_force_keeps_its_direction_within_the_limit_and_the_axes(device: ThreadedDevice, exchange: Exchange) -> None:
    device.open(0.0)
    assert told(device, exchange, (0.3, 0.0, -0.4)) == (0.3, 0.0, -0.4)
    assert told(device, exchange, (30.0, 0.0, -40.0)) == pytest.approx((1.8, 0.0, -2.4))
    assert told(device, exchange, (0.3, 100.0, -0.4)) == (0.3, 0.0, -0.4), "what it cannot display takes away nothing"


def test_the_same_time_gives_the_same_answer_and_another_the_newest(device: ThreadedDevice, exchange: Exchange) -> None:
    device.open(0.0)
    first = device.latest(1.0)
    before, gives_up = len(exchange.told), monotonic() + PATIENCE
    while len(exchange.told) < before + 2:
        assert monotonic() < gives_up
        sleep(TICK)
    assert device.latest(1.0) == first
    assert device.latest(1.001).at > first.at
    assert device.round_trip_s >= 0.0


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
