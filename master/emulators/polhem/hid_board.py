"""The emulated mbed boards that speak HID: the newer in lock-step, the older at its own rate.

As in their firmware, the newer sends a report and waits for one, of which it takes the newest; the older sends one each
frame and takes the oldest that waits. Either switches its amplifiers on with any report, and off after 0.5 s without.
Assumed: an amplifier follows its input to the end of the range, 3.75 A where 90 % mean 3 A.
"""

from collections import deque
from collections.abc import Mapping
from math import floor, inf, nextafter
from typing import ClassVar, Literal

from pydantic import Field

from weberlink.hardware.emulator import HidIdentity
from weberlink.master.devices.polhem.mechanism import Board
from weberlink.master.devices.polhem.protocol import (
    HID_WATCHDOG_S,
    LONG,
    SHORT,
    Counts,
    Sensors,
    SetCounters,
    decode_command,
    encode_sensors,
)
from weberlink.master.emulators.polhem.board import FAULTS, OFF, BoardOptions, PolhemBoard

VENDOR, PRODUCT = 0x1234, 0x0006
FRAME_S = 0.001  # frame period of full-speed USB [s]
LONG_LIMIT_MA, SHORT_LIMIT_MA = 3750.0, 3000.0


class PolhemHidEmulatorOptions(BoardOptions):
    """Options of the emulated `polhem_hid`. Without `parameters`, it is a WoodenHaptics of 2015."""

    report: Literal[14, 8] = Field(default=14, description="bytes of a report: 14 in lock-step, or the older 8")
    frame_s: float = Field(
        default=FRAME_S, ge=0.0, le=0.1, description="reports leave at multiples of it; 0: at once (of 14 bytes only)"
    )
    serial_number: str = Field(default="0123456789", description="by which two alike can be told apart")

    @property
    def board(self) -> Board:
        return "hid14" if self.report == LONG else "hid8"


class PolhemHidEmulator(PolhemBoard):
    """See `weberlink.hardware.emulator`."""

    Options = PolhemHidEmulatorOptions
    transport: ClassVar[str] = "hid"
    WATCHDOG_S = HID_WATCHDOG_S
    OWN_FAULTS: ClassVar[Mapping[str, str]] = {**FAULTS, "stylus": "the button of the stylus is pressed; 0: let go"}

    def __init__(self, options: PolhemHidEmulatorOptions) -> None:
        super().__init__(options)
        self.identity = HidIdentity(
            VENDOR, PRODUCT, "HID DEVICE", descriptor(options.report), options.report,
            options.serial_number, "mbed.org",
        )  # fmt: skip
        self._size = options.report
        self._frame = options.frame_s if self._size == LONG else options.frame_s or FRAME_S
        self._arrived: deque[bytes] = deque(maxlen=64)
        self._ready: bytes | None = None
        self._started = False
        self._stylus = False
        self._number = 0

    def receive(self, data: bytes, now: float) -> None:
        self.messages += 1
        if len(data) != self._size:
            self.errors += 1
            return
        self._arrived.append(data)
        if self._size == LONG and self._started and self._step_at is None:
            self._step_at = now + self._processing

    def advance(self, now: float) -> None:
        if not self._started:
            self._started = True
            self._advance_to(now)
            self._send_later(now)
        super().advance(now)

    def _step(self, at: float, now: float) -> None:
        if self._size == SHORT:  # once per frame; missed frames are skipped
            if self._arrived:
                self._obey(self._arrived.popleft(), SHORT_LIMIT_MA, at)
            self._number = (self._number + 1) & 0xFFFF
            self.leaving.append(self._report())
            self._send_later(now)
        elif self._ready is not None:
            self.leaving.append(self._ready)
            self._ready = None
            self._step_at = at + self._processing if self._arrived else None
        else:
            newest = self._arrived.pop()
            self._arrived.clear()
            self._obey(newest, LONG_LIMIT_MA, at)
            self._send_later(at)

    def _send_later(self, now: float) -> None:
        """Measure now, and send in the next frame."""
        self._ready = self._report()
        self._step_at = now
        if self._frame > 0.0:
            # Where a quotient is rounded down, the next frame would be the one that is over.
            self._step_at = max((floor(now / self._frame) + 1) * self._frame, nextafter(now, inf))

    def _obey(self, report: bytes, limit_ma: float, at: float) -> None:
        command = decode_command(report)
        if isinstance(command, SetCounters):
            self._drive(OFF, at)
            self._set_counters(self._wired(command.counts))
            self._button_pressed = False
        else:
            a, b, c = (min(max(float(current), -limit_ma), limit_ma) for current in command)
            self._drive((a, b, c), at)

    def _report(self) -> bytes:
        counts = self._wired(self.counts)
        if self._size == SHORT:
            return encode_sensors(Sensors(counts[:3], number=self._number))
        return encode_sensors(Sensors(counts, self._stylus, self._button_pressed))

    def _wired(self, counts: Counts) -> Counts:
        """Counts with those of the gimbal reversed where the device does so; its own inverse."""
        return (*counts[:3], *counts[:2:-1]) if self.mechanism.gimbal_reversed_over_hid else counts

    def apply_fault(self, name: str, value: float) -> None:
        if name == "stylus":
            self._stylus = value != 0
        elif name == "restart":
            self._started, self._ready = False, None
            self._arrived.clear()
        super().apply_fault(name, value)


def descriptor(size: int) -> bytes:
    """Report descriptor with one unnumbered report each way and a vendor-defined usage."""
    return bytes.fromhex(f"06abff 0a0002 a101 7508 1500 25ff 95{size:02x} 0901 8102 95{size:02x} 0902 9102 c0")
