"""The emulated board with the bracket protocol.

As in firmware 2.0 (forsslund/woodenhaptics, woody_teensy_mini.ino), every message gets exactly one answer; a wrong one
gives no current and does not feed the watchdog. Of two messages at once, the first takes the beginning of the second:
they are answered with errors 8 and 256. One sensor of the gimbal is read per message, after the currents were set.
"""

import re
from collections.abc import Mapping
from typing import ClassVar

from pydantic import Field

from weberlink.master.devices.polhem.mechanism import Board
from weberlink.master.devices.polhem.parameters import MODEL_SETS, Model
from weberlink.master.devices.polhem.protocol import (
    CURRENT_LIMIT_MA,
    NUMBERS,
    SERIAL_WATCHDOG_S,
    Counts,
    Sensors,
    encode_status,
)
from weberlink.master.emulators.polhem.board import FAULTS, BoardOptions, Currents, PolhemBoard

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
