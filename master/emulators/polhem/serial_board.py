"""The board of the devices on a serial port, emulated: brackets in, brackets out.

As firmware 2.0 has been described: exactly one answer for every message, right or wrong, and no current from a wrong
one. Guessed: that what comes behind a message in the same instant is dropped with it, and that a wrong message does not
feed the watchdog.
"""

import re
from collections.abc import Mapping
from typing import ClassVar

from pydantic import Field

from master.devices.polhem.bracket import CURRENT_LIMIT_MA, MODELS, WATCHDOG_S, Status, encode_status
from master.devices.polhem.options import Model
from master.devices.polhem.parameters import MODEL_SETS, PARAMETERS
from master.emulators.polhem.board import Board
from master.emulators.polhem.body import FAULTS, BodyOptions, Counts6, Currents

BUFFER = 127
FILLING = b"\n\r\0"
"""What may stand around a message."""
TRAILING, FULL, NO_BEGINNING, NOT_THREE, UNREADABLE = 8, 128, 256, 512, 1024
NUMBERS = {name: number for number, name in MODELS.items()}
NO_COUNTS: Counts6 = (0, 0, 0, 0, 0, 0)

_NUMBER = re.compile(rb"\s*([+-]?\d{1,10})")


class PolhemSerialEmulatorOptions(BodyOptions):
    """Options of the emulated `polhem_serial`. Without `parameters`, it has the set of the model."""

    model: Model = Field(default="vintage_phantom", description="that it says it is")


class PolhemSerialEmulator(Board):
    """See `hardware.emulator`."""

    Options = PolhemSerialEmulatorOptions
    transport: ClassVar[str] = "serial"
    OWN_FAULTS: ClassVar[Mapping[str, str]] = {
        **FAULTS,
        "gimbal_error": "every answer has these error bits too: 1, 2, 4 or their sum; 0: none",
        "wrong_model": "it says to be model 1, 2 or 3; 0: what it is",
    }

    def __init__(self, options: PolhemSerialEmulatorOptions | None = None) -> None:
        options = PolhemSerialEmulatorOptions() if options is None else options
        self.model = self._true_model = NUMBERS[options.model]
        """What it says it is."""
        super().__init__(options, PARAMETERS[options.parameters or MODEL_SETS[self.model]], WATCHDOG_S)
        self._waiting = b""
        self._work: tuple[float, bytes] | None = None
        self._answers: list[bytes] = []
        self._last_counts = NO_COUNTS
        self._gimbal_error = 0

    def receive(self, data: bytes, now: float) -> None:
        self._waiting += data
        self._begin(now)

    def advance(self, now: float) -> None:
        while self._work is not None and self._work[0] <= now:
            at, text = self._work
            self._work = None
            self._body.advance(at)
            self._calibrate()
            self._answer(text, at)
            self._begin(at)
        self._body.advance(now)
        self._take_orders()
        self._calibrate()

    def replies(self, now: float) -> list[bytes]:  # noqa: ARG002 - an answer leaves when it is made
        answers, self._answers = self._answers, []
        return answers

    def next_timer(self) -> float | None:
        due = [each for each in (self._work and self._work[0], self._body.next_timer) if each is not None]
        return min(due, default=None)

    def _begin(self, now: float) -> None:
        """Take all that has come, if it is a message or too much for one and the last one is done."""
        if self._work is not None:
            return
        self._waiting = self._waiting.lstrip(FILLING)
        if b"]" in self._waiting or len(self._waiting) > BUFFER:
            self._work = (now + self._processing, self._waiting)
            self._waiting = b""

    def _answer(self, text: bytes, now: float) -> None:
        self.messages += 1
        currents, error = _read(text)
        if currents is None:
            self.errors += 1
        else:
            self._body.drive(currents, now)
            *main, d, e, f = self._body.counts
            gimbal = self._last_counts[3:] if self._gimbal_error else (d, e, f)
            self._last_counts = (*main, *gimbal)  # type: ignore[assignment]
        self._answers.append(encode_status(Status(self.model, self._last_counts, error | self._gimbal_error)))

    def _calibrate(self) -> None:
        if self._body.button_pressed:
            self._body.button_pressed = False
            self._body.set_counters(NO_COUNTS)

    def _suffer(self, name: str, value: float) -> None:
        match name:
            case "wrong_model":
                self.model = int(value) or self._true_model
            case "gimbal_error":
                self._gimbal_error = int(value)
            case "restart":
                self._waiting, self._work, self._last_counts = b"", None, NO_COUNTS
                self._answers.clear()
        super()._suffer(name, value)


def _read(text: bytes) -> tuple[Currents | None, int]:
    """The currents of a message [mA], none where one is too large; or None and what is wrong."""
    head, bracket, tail = text[: BUFFER + 1].partition(b"]")
    if not bracket:
        return None, FULL
    if tail.strip(FILLING):
        return None, TRAILING
    _, beginning, numbers = head.partition(b"[")
    if not beginning:
        return None, NO_BEGINNING
    parts = numbers.split(b",")
    if len(parts) != 3:
        return None, NOT_THREE
    matches = [_NUMBER.fullmatch(part) for part in parts]
    if None in matches:
        return None, UNREADABLE
    a, b, c = (int(part) for part in parts)
    return (_allowed(a), _allowed(b), _allowed(c)), 0


def _allowed(current_ma: int) -> float:
    return float(current_ma) if abs(current_ma) <= CURRENT_LIMIT_MA else 0.0
