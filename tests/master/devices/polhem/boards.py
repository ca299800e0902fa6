"""Scripted boards, just enough to see what a driver does: one behind a pty, one in place of a HID port."""

from collections import deque
from time import monotonic, sleep

from weberlink.hardware.emulator import WireFaults
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.guardian import Guardian
from weberlink.master.devices.polhem.hid_protocol import LONG, Sensors, SetCounters, decode_command, encode_sensors
from weberlink.master.devices.polhem.serial_protocol import SerialStatus, decode_currents, encode_status

Counts6 = tuple[int, int, int, int, int, int]


class Teensy:
    """Answers every message as the firmware does. Its counters are `counts`, whoever sets them."""

    def __init__(self, model: int = 3, counts: Counts6 = (0, 0, 0, 0, 0, 0)) -> None:
        self.faults = WireFaults()
        self.model = model
        self.counts = counts
        self.error = 0
        self.currents: list[tuple[int, int, int]] = []
        """As commanded, one per message."""
        self._rest = b""
        self._answers: deque[bytes] = deque()

    def receive(self, data: bytes, now: float) -> None:
        *messages, self._rest = (self._rest + data.replace(b"\0", b"")).split(b"\n")
        for message in messages:
            self.currents.append(decode_currents(message))
            self._answers.append(encode_status(SerialStatus(self.model, self.counts, self.error)))

    def advance(self, now: float) -> None:
        pass

    def replies(self, now: float) -> list[bytes]:
        answers = list(self._answers)
        self._answers.clear()
        return answers

    def next_timer(self) -> float | None:
        return None


class ScriptedHidBoard:
    """In place of a `HidPort`: in lock-step, and with a report that waits from the start."""

    def __init__(self, counts: tuple[int, ...] = (0,) * 6, stale: tuple[int, ...] | None = None) -> None:
        self.counts = counts
        self.button = False
        self.calibrate = False
        self.plugged = True
        self.mute = 0
        """How many reports more are lost."""
        self.size = LONG
        self.sets_counters = True
        self.commands: list[tuple[int, int, int] | SetCounters] = []
        self.closed = 0
        self._waiting: deque[bytes] = deque()
        if stale is not None:
            self._waiting.append(encode_sensors(Sensors(stale)))

    def __call__(self, path: str) -> "ScriptedHidBoard":
        if not self.plugged:
            raise HardwareFault(f"{path}: there is no such device")
        return self

    def write(self, report: bytes) -> None:
        if not self.plugged:
            raise HardwareFault("/dev/hidraw9: unplugged")
        command = decode_command(report)
        self.commands.append(command)
        if isinstance(command, SetCounters) and self.sets_counters:
            self.counts, self.calibrate = command.counts, False
        if self.mute:
            self.mute -= 1
            return
        self._waiting.append(encode_sensors(Sensors(self.counts, self.button, self.calibrate)).ljust(self.size, b"\0"))

    def read_all(self, until: float) -> list[bytes]:
        if not self.plugged:
            raise HardwareFault("/dev/hidraw9: unplugged")
        if not self._waiting:
            sleep(max(0.0, until - monotonic()))
        reports = list(self._waiting)
        self._waiting.clear()
        return reports

    def guard(self, guardian: Guardian) -> None:
        self.guardian = guardian

    def close(self) -> None:
        self.closed += 1
