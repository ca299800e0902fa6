"""The emulated boards of the Polhem: mbeds that speak HID, the newer in lock-step, the older on its own, and a Teensy.

As in their firmware, the newer mbed sends a report and waits for one, of which it takes the newest; the older sends one
each frame and takes the oldest that waits. Either switches its amplifiers on with any report, and off after 0.5 s
without. Assumed: an amplifier follows its input to the end of the range, 3.75 A where 90 % mean 3 A.

The Teensy speaks the bracket protocol. As in firmware 2.0 (forsslund/woodenhaptics, woody_teensy_mini.ino), every
message gets exactly one answer; a wrong one gives no current and does not feed the watchdog. Of two messages at once,
the first takes the beginning of the second: they are answered with errors 8 and 256. One sensor of the gimbal is read
per message, after the currents were set.
"""

import re
from collections import deque
from collections.abc import Mapping
from math import floor, inf, nextafter
from typing import ClassVar, Literal

from pydantic import Field

from weberlink.master.devices.polhem.mechanism import Board
from weberlink.master.devices.polhem.parameters import MODEL_SETS, Model
from weberlink.master.devices.polhem.protocol import (
    CURRENT_LIMIT_MA,
    HID_WATCHDOG_S,
    LONG,
    NUMBERS,
    SERIAL_WATCHDOG_S,
    SHORT,
    Counts,
    Sensors,
    SetCounters,
    decode_command,
    encode_sensors,
    encode_status,
)
from weberlink_devices.polhem.emulated_board import FAULTS, OFF, BoardOptions, Currents, PolhemBoard
from weberlink_devices.umockdev import HidIdentity

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


# --- on a serial port

BUFFER = 127
FILLING = b"\n\r\0"  # bytes that are allowed around a message
TRAILING, FULL, NO_BEGINNING, NOT_THREE, UNREADABLE = 8, 128, 256, 512, 1024
NO_COUNTS: Counts = (0,) * 6

_THREE = re.compile(rb"\[\s*([+-]?\d+),\s*([+-]?\d+),\s*([+-]?\d+)")


class PolhemSerialEmulatorOptions(BoardOptions):
    """Options of the emulated `polhem_serial`. Without `parameters`, it has the set of the model."""

    model: Model = Field(default="vintage_phantom", description="that it says it is")

    @property
    def set_name(self) -> str:
        return self.parameters or MODEL_SETS[NUMBERS[self.model]]

    @property
    def board(self) -> Board:
        return "serial"


class PolhemSerialEmulator(PolhemBoard):
    """See `weberlink.hardware.emulator`."""

    Options = PolhemSerialEmulatorOptions
    transport: ClassVar[str] = "serial"
    WATCHDOG_S = SERIAL_WATCHDOG_S
    OWN_FAULTS: ClassVar[Mapping[str, str]] = {
        **FAULTS,
        "gimbal_error": "sensors of the gimbal that cannot be read: 1, 2, 4 or their sum; 0: none",
        "wrong_model": "it says to be model 1, 2 or 3; 0: what it is",
    }

    def __init__(self, options: PolhemSerialEmulatorOptions) -> None:
        self.model = self._true_model = NUMBERS[options.model]  # model number that it reports
        super().__init__(options)
        self._waiting = b""
        self._buffer = b""
        self._work = b"", 0  # the message that takes effect next, up to its closing bracket, and its error
        self._loops = 0
        self._counts = NO_COUNTS  # counts as last read, which an answer with an error repeats
        self._gimbal_error = 0

    def receive(self, data: bytes, now: float) -> None:
        self._waiting += data
        self._begin(now)

    def _begin(self, now: float) -> None:
        """Read up to the end of a message, unless the last one is still being processed (`await_message`)."""
        if self._step_at is not None:
            return
        end = self._waiting.find(b"]", 0, BUFFER - len(self._buffer))
        taken = end + 1 or BUFFER - len(self._buffer)
        self._buffer += self._waiting[:taken]
        self._waiting = self._waiting[taken:]
        if end < 0 and len(self._buffer) < BUFFER:
            return
        text, self._buffer, error = self._buffer, b"", 0
        if end < 0:
            error = FULL
        elif b"[" not in text:
            error = NO_BEGINNING
        elif text.count(b",") != 2:  # commas before its beginning count too
            error = NOT_THREE
        else:
            waiting = self._waiting.lstrip(FILLING)  # dropped, as far as it has come by now
            error = TRAILING if waiting else 0
            self._waiting = waiting[1:]
        self._work, self._step_at = (text, error), now + self._processing

    def _step(self, at: float, now: float) -> None:  # noqa: ARG002
        text, error = self._work
        self.messages += 1
        self._loops += 1
        currents = None if error else _currents(text)
        if currents is None:
            error = error or UNREADABLE
            self.errors += 1
        else:
            self._drive(currents, at)
            error = self._measure()
        self.leaving.append(encode_status(Sensors(self._counts, model=self.model, error=error)))
        self._begin(at)

    def _measure(self) -> int:
        """Read the motor encoders and one gimbal sensor in turn; gives the error bit of that sensor."""
        counts, sensor = self.counts, self._loops % 3
        error, gimbal = self._gimbal_error & 1 << sensor, list(self._counts[3:])
        if not error:
            gimbal[sensor] = counts[3 + sensor]
        self._counts = (*counts[:3], *gimbal)
        return error

    def apply_fault(self, name: str, value: float) -> None:
        match name:
            case "wrong_model":
                self.model = int(value) or self._true_model
            case "gimbal_error":
                self._gimbal_error = int(value)
            case "button":  # the board itself sets its counters to zero
                self._set_counters(NO_COUNTS)
                self._counts = NO_COUNTS
            case "restart":
                self._waiting, self._buffer, self._counts = b"", b"", NO_COUNTS
        super().apply_fault(name, value)


def _currents(text: bytes) -> Currents | None:
    """Currents [mA] as `sscanf` reads them from the last bracket on, 0 if too large; None if unreadable."""
    match = _THREE.match(text[text.rfind(b"[") :].split(b"\0")[0])
    if match is None:
        return None
    a, b, c = (current if abs(current := float(part)) <= CURRENT_LIMIT_MA else 0.0 for part in match.groups())
    return (a, b, c)
