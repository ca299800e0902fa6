"""Scripted boards, just enough to see what a driver does: one for a serial port, one for reports."""

from typing import Any

from weberlink.hardware.emulator import Emulator
from weberlink.master.devices.polhem.driver import PolhemDevice
from weberlink.master.devices.polhem.hid_device import PolhemHidDevice
from weberlink.master.devices.polhem.parameters import PolhemHidOptions
from weberlink.master.devices.polhem.protocol import (
    LONG,
    Sensors,
    SetCounters,
    decode_command,
    encode_sensors,
    encode_status,
)
from weberlink.testing.time import TICK
from weberlink.testing.wires import HidWire


class Teensy(Emulator):
    """Answers every message as the firmware does. Its counters are `counts`, whoever sets them."""

    def __init__(self, counts: tuple[int, int, int, int, int, int]) -> None:
        super().__init__()
        self.model, self.counts, self.error = 3, counts, 0
        self.currents: list[tuple[int, int, int]] = []  # as commanded, one per message
        self._rest = b""

    def receive(self, data: bytes, now: float) -> None:
        *messages, self._rest = (self._rest + data.replace(b"\0", b"")).split(b"\n")
        for message in messages:
            a, b, c = map(int, message.strip(b"[]").split(b","))
            self.currents.append((a, b, c))
            self.leaving.append(encode_status(Sensors(self.counts, model=self.model, error=self.error)))


class ScriptedHidBoard(Emulator):
    """In lock-step, and with a report that may wait from the start."""

    def __init__(self, counts: tuple[int, ...], size: int = LONG, stale: tuple[int, ...] | None = None) -> None:
        super().__init__()
        self.counts, self.size = counts, size
        self.button = self.calibrate = False
        self.sets_counters = True
        self.commands: list[tuple[int, int, int] | SetCounters] = []
        self.leaving = [] if stale is None else [encode_sensors(Sensors(stale))]

    def receive(self, data: bytes, now: float) -> None:
        command = decode_command(data)
        self.commands.append(command)
        if isinstance(command, SetCounters) and self.sets_counters:
            self.counts, self.calibrate = command.counts, False
        sensors = Sensors(self.counts, self.button, self.calibrate)
        self.leaving.append(encode_sensors(sensors).ljust(self.size, b"\0"))


def hid_device(wire: HidWire, *, checked: bool = True, **settings: Any) -> PolhemDevice:
    """A `polhem_hid` with a board in place of its port."""
    options = PolhemHidOptions(port="/dev/hidraw9", **settings)
    signs = PolhemHidDevice.fingerprint(options)
    options = options.model_copy(update={"signs_checked": signs if checked else None})
    return PolhemHidDevice(options, TICK, wire)
