"""The bracket protocol of the devices on a serial port: currents out, encoder counts in.

Every message `[a,b,c]` with currents in mA is answered by exactly one `[model,e0,...,e5,error]`. An answer with an
error of the message repeats the last counts, and the currents were not applied; one of `GIMBAL_ERRORS` comes after they
were. Sources: firmware 2.0 and its maker's host code.
"""

import re
from dataclasses import dataclass
from itertools import repeat
from time import monotonic

from weberlink.hardware.serial_port import SerialPort

CURRENT_LIMIT_MA = 6000
"""Beyond this the firmware gives a motor no current at all."""

WATCHDOG_S = 0.1
"""The device switches its motors off after this time without a message [s]."""

LEAST_WRITE = 16
"""Messages are padded with NUL to this length: shorter writes are slower, according to the maker."""

MODELS = {1: "polhem", 2: "vintage_phantom", 3: "woodenhaptics"}

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

GIMBAL_ERRORS = 1 | 2 | 4
"""Errors after which the message was applied and the three main counts are valid."""

LONGEST = 8 * 12 + 2
"""Longest answer: eight numbers of 32 bits with separators."""

Currents = tuple[int, int, int]
Counts6 = tuple[int, int, int, int, int, int]

_STATUS = re.compile(rb"\[(-?\d{1,10}(?:,-?\d{1,10}){7})\]")
_COMMAND = re.compile(rb"\[(-?\d{1,10}),(-?\d{1,10}),(-?\d{1,10})\][\n\r\0]*")


@dataclass(frozen=True, slots=True)
class SerialStatus:
    """An answer of the device: its model, six encoder counts, and `ERRORS` or-ed together."""

    model: int
    counts: Counts6
    error: int = 0


def encode_currents(currents_ma: Currents) -> bytes:
    """The message that commands currents [mA].

    Raises:
        ValueError: for a current that the device would take for zero.
    """
    if max(map(abs, currents_ma)) > CURRENT_LIMIT_MA:
        raise ValueError(f"expected currents within +-{CURRENT_LIMIT_MA} mA, got {currents_ma}")
    return (b"[%d,%d,%d]\n" % currents_ma).ljust(LEAST_WRITE, b"\0")


def decode_currents(message: bytes) -> Currents:
    """The currents that one whole message commands [mA], within the limit or not.

    Raises:
        ValueError: if it is no such message.
    """
    match = _COMMAND.fullmatch(message)
    if match is None:
        raise ValueError(f"expected [mA,mA,mA], got {message!r}")
    a, b, c = (int(part) for part in match.groups())
    return (a, b, c)


def encode_status(status: SerialStatus) -> bytes:
    return b"[%d,%d,%d,%d,%d,%d,%d,%d]\n" % (status.model, *status.counts, status.error)


class SerialStatusReader:
    """Finds answers in a stream that may begin anywhere and contain errors; never raises."""

    def __init__(self) -> None:
        self._rest = b""
        self.malformed = 0
        """Number of malformed answers."""

    def feed(self, data: bytes) -> list[SerialStatus]:
        """The answers that end in `data`, oldest first."""
        *ended, rest = (self._rest + data).split(b"]")
        self._rest = rest[-LONGEST:]
        answers = []
        for each in ended:
            answer = _status(each[each.rfind(b"[") :] + b"]")
            if answer is None:
                self.malformed += 1
            else:
                answers.append(answer)
        return answers

    @property
    def kept(self) -> int:
        """Number of buffered bytes."""
        return len(self._rest)


def _status(message: bytes) -> SerialStatus | None:
    match = _STATUS.fullmatch(message)
    if match is None:
        return None
    model, a, b, c, d, e, f, error = (int(part) for part in match[1].split(b","))
    return SerialStatus(model, (a, b, c, d, e, f), error)


def complaint(error: int) -> str:
    """The bits of an error in words; empty for none."""
    words = [words for bit, words in ERRORS.items() if error & bit]
    unknown = error & ~sum(ERRORS)
    return ", ".join([*words, *([f"error {unknown}"] if unknown else [])])


class SerialLine:
    """An open port; see `lock_step.MessageLine`.

    Raises:
        HardwareFault: it cannot be opened.
    """

    def __init__(self, path: str) -> None:
        self._port = SerialPort(path)
        self._reader = SerialStatusReader()

    def send(self, message: Currents) -> None:
        self._port.write(encode_currents(message))

    def hear(self, until: float) -> list[SerialStatus | None]:
        reader = self._reader
        while data := self._port.read(until):
            malformed = reader.malformed
            good = reader.feed(data)
            # The order within a burst does not matter: more than one answer is an error anyway.
            answers: list[SerialStatus | None] = [*repeat(None, reader.malformed - malformed), *good]
            if answers:
                return answers
            if monotonic() > until:
                break
        return []

    def close(self) -> None:
        self._port.close()
