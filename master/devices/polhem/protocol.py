"""What the boards of Polhem and its relatives send and understand: HID reports, and lines of text on a serial port.

An mbed sends and takes reports of 14 bytes, after each of which it waits for one from the host (lock-step), or of 8 at
its own rate. It counts in 32 bits and reports 16; `unwrapped` restores the count. A Teensy answers every message
`[a,b,c]` with currents in mA by exactly one `[model,e0,...,e5,error]`. An answer with an error of the message repeats
the last counts, and the currents were not applied; one of `GIMBAL_ERRORS` comes after they were.

Sources: firmware and host code of the makers, the serial board with firmware 2.0.
"""

import re
from dataclasses import dataclass
from struct import Struct
from typing import NamedTuple

HID_WATCHDOG_S, SERIAL_WATCHDOG_S = 0.5, 0.1  # a board switches its motors off after this time without a message [s]

Currents = tuple[int, int, int]  # [mA]
Counts = tuple[int, ...]  # of the sensors: six, or three in a report of 8 bytes
NO_CURRENT: Currents = (0, 0, 0)


@dataclass(frozen=True, slots=True)
class SetCounters:
    """Command that the counters hold these counts from now on, and no current; in reports of 14 bytes only."""

    counts: Counts  # six


Message = Currents | SetCounters


class Sensors(NamedTuple):
    """What a board says of itself."""

    counts: Counts  # in reports of 16 bits each
    button: bool = False  # whether that of the stylus is pressed; in reports of 14 bytes only
    calibrate: bool = False  # whether the calibration button was pressed since the counters were last set; likewise
    number: int = 0  # of a report of 8 bytes, 16 bits
    model: int = 0  # one of `MODELS`, over serial
    error: int = 0  # `ERRORS` or-ed together, over serial


# --- HID

# While the button of the stylus is pressed, the offset is added to the fourth counter.
BUTTON_ABOVE, BUTTON_OFFSET = 5000, 10_000
CURRENTS, SET_COUNTERS = 0, 1  # what a report of 14 bytes commands
_LONG, _SHORT = Struct("<7h"), Struct("<3hH")
LONG, SHORT = _LONG.size, _SHORT.size  # bytes in a report of the newer and of the older kind


def decode_sensors(report: bytes) -> Sensors:
    """Of a report of `LONG` or `SHORT` bytes; raises struct.error for another one."""
    if len(report) == LONG:
        *counts, info = _LONG.unpack(report)
        pressed = counts[3] > BUTTON_ABOVE
        if pressed:
            counts[3] -= BUTTON_OFFSET
        return Sensors(tuple(counts), pressed, info == 1)
    *counts, number = _SHORT.unpack(report)
    return Sensors(tuple(counts), number=number)


def encode_sensors(sensors: Sensors) -> bytes:
    """Counts beyond 16 bits lose their upper ones, as in the device."""
    counts = [wrapped(count) for count in sensors.counts]
    if len(counts) == 3:
        return _SHORT.pack(*counts, sensors.number & 0xFFFF)
    if sensors.button:
        counts[3] = wrapped(counts[3] + BUTTON_OFFSET)
    return _LONG.pack(*counts, int(sensors.calibrate))


def encode_command(command: Message, size: int, number: int = 0) -> bytes:
    """A report of `size` bytes, `LONG` or `SHORT`, without the report number that hidapi wants in front; `number` goes
    into the older kind only. Raises ValueError if that is to set counters, or there is no such kind.
    """
    if size == SHORT and not isinstance(command, SetCounters):
        return _SHORT.pack(*command, number & 0xFFFF)
    if size != LONG:
        raise ValueError(f"expected a report of {LONG} bytes, got {size} for {command}")
    if isinstance(command, SetCounters):
        a, b, c, d, e, f = map(wrapped, command.counts)
        return _LONG.pack(d, e, f, SET_COUNTERS, a, b, c)
    return _LONG.pack(*command, CURRENTS, 0, 0, 0)


def decode_command(report: bytes) -> Message:
    """As the device understands it: whatever is not command 1 is currents. Raises as `decode_sensors`."""
    if len(report) == LONG:
        d, e, f, command, a, b, c = _LONG.unpack(report)
        return SetCounters((a, b, c, d, e, f)) if command == SET_COUNTERS else (d, e, f)
    a, b, c, _ = _SHORT.unpack(report)
    return (a, b, c)


def wrapped(count: int) -> int:
    """The lower 16 bits of a count, as a signed number."""
    return (count + 0x8000 & 0xFFFF) - 0x8000


def unwrapped(counts: Counts, before: Counts | None) -> Counts:
    """Counts beyond 16 bits, given those before them; correct while none moves by 32768 or more between the two."""
    if before is None:
        return counts
    return tuple(last + wrapped(now - last) for last, now in zip(before, counts, strict=True))


# --- serial

CURRENT_LIMIT_MA = 6000  # beyond this the firmware gives a motor no current at all
LEAST_WRITE = 16  # messages are padded with NUL to this length: shorter writes are slower, according to the maker
MODELS = {1: "polhem", 2: "vintage_phantom", 3: "woodenhaptics"}
NUMBERS = {name: number for number, name in MODELS.items()}
ERRORS = {
    1: "gimbal sensor 1 does not answer",
    2: "gimbal sensor 2 does not answer",
    4: "gimbal sensor 3 does not answer",
    8: "two messages at once",
    128: "message too long",
    256: "message without a beginning",
    512: "message without its three currents",
    1024: "message that it cannot read",
}
"""Bits of the last number of an answer."""
GIMBAL_ERRORS = 1 | 2 | 4  # errors after which the message was applied and the three main counts are valid
LONGEST = 8 * 12 + 2  # longest answer: eight numbers of 32 bits with separators

_STATUS = re.compile(rb"\[(-?\d{1,10}(?:,-?\d{1,10}){7})\]")


def encode_currents(currents_ma: Currents) -> bytes:
    """The message that commands currents [mA]; raises ValueError for one that the device would take for zero."""
    if max(map(abs, currents_ma)) > CURRENT_LIMIT_MA:
        raise ValueError(f"expected currents within +-{CURRENT_LIMIT_MA} mA, got {currents_ma}")
    return (b"[%d,%d,%d]\n" % currents_ma).ljust(LEAST_WRITE, b"\0")


def encode_status(status: Sensors) -> bytes:
    return b"[%d,%d,%d,%d,%d,%d,%d,%d]\n" % (status.model, *status.counts, status.error)


class StatusReader:
    """Finds answers in a stream that may begin anywhere and contain errors; never raises."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[Sensors | None]:
        """The answers that end in `data`, oldest first; None for one that is malformed."""
        *ended, rest = (self._rest + data).split(b"]")
        self._rest = rest[-LONGEST:]
        answers: list[Sensors | None] = []
        for each in ended:
            match = _STATUS.fullmatch(each[each.rfind(b"[") :] + b"]")
            if match is None:
                answers.append(None)
            else:
                model, *counts, error = (int(part) for part in match[1].split(b","))
                answers.append(Sensors(tuple(counts), model=model, error=error))
        return answers


def complaint(error: int) -> str:
    """The bits of an error in words; empty for none."""
    words = [words for bit, words in ERRORS.items() if error & bit]
    unknown = error & ~sum(ERRORS)
    return ", ".join([*words, *([f"error {unknown}"] if unknown else [])])
