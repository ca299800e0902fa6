"""Scripted boards, just enough to see what a driver does: one behind a pty, one in place of a HID port."""

import re
from time import monotonic, sleep
from typing import Any

from weberlink.hardware.emulator import Emulator
from weberlink.hardware.guardian import Guardian
from weberlink.master.devices.polhem.driver import PolhemDevice
from weberlink.master.devices.polhem.hid_device import PolhemHidDevice
from weberlink.master.devices.polhem.parameters import PolhemHidOptions
from weberlink.master.devices.polhem.protocol import (
    LONG,
    Currents,
    Sensors,
    SetCounters,
    decode_command,
    encode_sensors,
    encode_status,
)
from weberlink.testing.time import TICK

_COMMAND = re.compile(rb"\[(-?\d{1,10}),(-?\d{1,10}),(-?\d{1,10})\][\n\r\0]*")


def decode_currents(message: bytes) -> Currents:
    """The currents that one whole message commands [mA], within the limit or not; raises ValueError if it is none."""
    match = _COMMAND.fullmatch(message)
    if match is None:
        raise ValueError(f"expected [mA,mA,mA], got {message!r}")
    a, b, c = (int(part) for part in match.groups())
    return (a, b, c)


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
            self.currents.append(decode_currents(message))
            self.leaving.append(encode_status(Sensors(self.counts, model=self.model, error=self.error)))


class ScriptedHidBoard:
    """In place of a `HidPort`: in lock-step, and with a report that may wait from the start."""

    def __init__(self, counts: tuple[int, ...], size: int = LONG, stale: tuple[int, ...] | None = None) -> None:
        self.counts, self.size = counts, size
        self.button = self.calibrate = False
        self.sets_counters = True
        self.commands: list[tuple[int, int, int] | SetCounters] = []
        self.closed = 0
        self._waiting = [] if stale is None else [encode_sensors(Sensors(stale))]

    def __call__(self, path: str) -> "ScriptedHidBoard":
        return self

    def write(self, report: bytes) -> None:
        command = decode_command(report)
        self.commands.append(command)
        if isinstance(command, SetCounters) and self.sets_counters:
            self.counts, self.calibrate = command.counts, False
        sensors = Sensors(self.counts, self.button, self.calibrate)
        self._waiting.append(encode_sensors(sensors).ljust(self.size, b"\0"))

    def read_all(self, until: float) -> list[bytes]:
        if not self._waiting:
            sleep(max(0.0, until - monotonic()))
        reports, self._waiting = self._waiting, []
        return reports

    def guard(self, guardian: Guardian) -> None: ...

    def close(self) -> None:
        self.closed += 1


def hid_device(board: Any, *, checked: bool = True, **settings: Any) -> PolhemDevice:
    """A `polhem_hid` on a board in place of its port."""
    options = PolhemHidOptions(port="/dev/hidraw9", **settings)
    signs = PolhemHidDevice.fingerprint(options)
    options = options.model_copy(update={"signs_checked": signs if checked else None})
    return PolhemHidDevice(options, TICK, board)
