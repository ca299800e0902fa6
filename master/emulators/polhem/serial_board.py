"""The emulated board with the bracket protocol.

As in firmware 2.0 (forsslund/woodenhaptics, woody_teensy_mini.ino), every message gets exactly one answer; a wrong one
gives no current and does not feed the watchdog. Of two messages at once, the first takes the beginning of the second:
they are answered with errors 8 and 256. One sensor of the gimbal is read per message, after the currents were set.
"""

import re
from collections.abc import Mapping
from typing import ClassVar

from pydantic import Field

from weberlink.master.devices.polhem.options import Model
from weberlink.master.devices.polhem.parameters import MODEL_SETS
from weberlink.master.devices.polhem.protocol import (
    CURRENT_LIMIT_MA,
    MODELS,
    SERIAL_WATCHDOG_S,
    Counts6,
    Sensors,
    encode_status,
)
from weberlink.master.emulators.polhem.board import FAULTS, BoardOptions, Currents, PolhemBoard
from weberlink.master.emulators.polhem.host_wiring import HostWiring, host_wiring

BUFFER = 127
FILLING = b"\n\r\0"
"""Bytes that are allowed around a message."""
TRAILING, FULL, NO_BEGINNING, NOT_THREE, UNREADABLE = 8, 128, 256, 512, 1024
NUMBERS = {name: number for number, name in MODELS.items()}
NO_COUNTS: Counts6 = (0, 0, 0, 0, 0, 0)

_THREE = re.compile(rb"\[\s*([+-]?\d+),\s*([+-]?\d+),\s*([+-]?\d+)")


class PolhemSerialEmulatorOptions(BoardOptions):
    """Options of the emulated `polhem_serial`. Without `parameters`, it has the set of the model."""

    model: Model = Field(default="vintage_phantom", description="that it says it is")

    @property
    def set_name(self) -> str:
        return self.parameters or MODEL_SETS[NUMBERS[self.model]]

    def wiring(self) -> HostWiring:
        return host_wiring(self.set_name, "serial")


class PolhemSerialEmulator(PolhemBoard):
    """See `weberlink.hardware.emulator`."""

    Options = PolhemSerialEmulatorOptions
    transport: ClassVar[str] = "serial"
    OWN_FAULTS: ClassVar[Mapping[str, str]] = {
        **FAULTS,
        "gimbal_error": "sensors of the gimbal that cannot be read: 1, 2, 4 or their sum; 0: none",
        "wrong_model": "it says to be model 1, 2 or 3; 0: what it is",
    }

    def __init__(self, options: PolhemSerialEmulatorOptions | None = None) -> None:
        options = PolhemSerialEmulatorOptions() if options is None else options
        self.model = self._true_model = NUMBERS[options.model]
        """Model number that it reports."""
        super().__init__(options, SERIAL_WATCHDOG_S)
        self._waiting = b""
        self._buffer = b""
        self._work: tuple[float, bytes, int] | None = None
        """When a message takes effect, its bytes up to the closing bracket, and their error."""
        self._answers: list[bytes] = []
        self._loops = 0
        self._counts = NO_COUNTS
        """Counts as last read, which an answer with an error repeats."""
        self._gimbal_error = 0

    def receive(self, data: bytes, now: float) -> None:
        self._waiting += data
        self._begin(now)

    def advance(self, now: float) -> None:
        while self._work is not None and self._work[0] <= now:
            at, text, error = self._work
            self._work = None
            self._advance_to(at)
            self._calibrate()
            self._answer(text, error, at)
            self._begin(at)
        self._advance_to(now)
        self.take_faults()
        self._calibrate()

    def replies(self, now: float) -> list[bytes]:  # noqa: ARG002 - an answer leaves when it is made
        answers, self._answers = self._answers, []
        return answers

    def next_timer(self) -> float | None:
        due = [each for each in (self._work and self._work[0], self._off_at) if each is not None]
        return min(due, default=None)

    def _begin(self, now: float) -> None:
        """Read up to the end of a message, unless the last one is still being processed (`await_message`)."""
        if self._work is not None:
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
        self._work = (now + self._processing, text, error)

    def _answer(self, text: bytes, error: int, now: float) -> None:
        self.messages += 1
        self._loops += 1
        currents = None if error else _currents(text)
        if currents is None:
            error = error or UNREADABLE
            self.errors += 1
        else:
            self._drive(currents, now)
            error = self._measure()
        self._answers.append(encode_status(Sensors(self._counts, model=self.model, error=error)))

    def _measure(self) -> int:
        """Read the motor encoders and one gimbal sensor in turn; gives the error bit of that sensor."""
        a, b, c, *gimbal = self.counts
        d, e, f = self._counts[3:]
        sensor = self._loops % 3
        error = self._gimbal_error & 1 << sensor
        if not error:
            d, e, f = (new if i == sensor else old for i, (old, new) in enumerate(zip((d, e, f), gimbal, strict=True)))
        self._counts = (a, b, c, d, e, f)
        return error

    def _calibrate(self) -> None:
        if self._button_pressed:
            self._button_pressed = False
            self._set_counters(NO_COUNTS)
            self._counts = NO_COUNTS

    def apply_fault(self, name: str, value: float) -> None:
        match name:
            case "wrong_model":
                self.model = int(value) or self._true_model
            case "gimbal_error":
                self._gimbal_error = int(value)
            case "restart":
                self._waiting, self._buffer, self._work, self._counts = b"", b"", None, NO_COUNTS
                self._answers.clear()
        super().apply_fault(name, value)


def _currents(text: bytes) -> Currents | None:
    """Currents [mA] as `sscanf` reads them from the last bracket on, 0 if too large; None if unreadable."""
    match = _THREE.match(text[text.rfind(b"[") :].split(b"\0")[0])
    if match is None:
        return None
    a, b, c = (current if abs(current := float(part)) <= CURRENT_LIMIT_MA else 0.0 for part in match.groups())
    return (a, b, c)
