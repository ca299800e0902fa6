"""A device that displays torque beside force, in one command."""

from time import monotonic
from typing import Any

from weberlink.geometry.vector import ZERO
from weberlink.master.devices.contract import DeviceReading, DeviceSpec
from weberlink.testing.devices import drive
from weberlink_devices.threaded_torque import ThreadedTorqueDevice

TICK = 0.001
BOX = ((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1))


class Exchange:
    """Takes down the last command."""

    told: Any = None

    def open(self) -> DeviceReading:
        return DeviceReading(monotonic(), ZERO)

    def exchange(self, command: Any) -> DeviceReading:
        self.told = command
        return self.open()

    def close(self) -> None: ...


def test_torque_goes_with_the_force_within_limit_until_stale() -> None:
    exchange, push = Exchange(), (1.0, 0.0, 0.0)
    spec = DeviceSpec(
        "thing", "xyz", 3.0, 500.0, BOX, 1.0 / TICK, force_feedback=True, orientation=True, torque_n_m=0.2
    )
    device = ThreadedTorqueDevice(spec, exchange, TICK)
    device.turn((0.1, 0.0, 0.0), monotonic())  # of no effect before it is open
    device.open(monotonic())

    def turns() -> bool:
        assert exchange.told.torque[0] == 0.0
        device.turn((0.0, 7.0, 0.0), monotonic())
        return bool(exchange.told == (push, (0.0, 0.2, 0.0)))

    try:
        drive(device, lambda: exchange.told is not None)
        drive(device, turns, push)
        drive(device, lambda: exchange.told == (push, ZERO), push)
    finally:
        device.close()
