"""HID reports of the mbed boards, 14 bytes or the older 8, told apart by their length.

After every 14-byte report the device waits for one from the host (lock-step); with 8 bytes it sends at its own rate.
Encoders are counted in 32 bits but reported in 16; `Unwrapper` restores the count. Sources: firmware and host code of
the makers.
"""

from collections.abc import Callable
from dataclasses import dataclass
from struct import Struct
from typing import Protocol

from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.guardian import Guardian
from weberlink.hardware.hid_port import HidPort

WATCHDOG_S = 0.5
"""The device switches its motors off after this time without a report [s]."""

BUTTON_ABOVE = 5000
BUTTON_OFFSET = 10_000
"""While the button of the stylus is pressed, this is added to the fourth counter."""

CURRENTS, SET_COUNTERS = 0, 1
"""What a 14-byte report commands."""

_LONG = Struct("<7h")
_SHORT = Struct("<3hH")
LONG, SHORT = _LONG.size, _SHORT.size
"""Bytes in a report of the newer and of the older kind."""

Currents = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Sensors:
    """The contents of a report of the device.

    Args:
        counts: six of the newer kind, three of the older; 16 bits each.
        button: of the stylus; False for the older kind.
        calibrate: whether the calibration button was pressed since the counters were last set; False for the older.
        number: of the report, 16 bits; 0 for the newer kind.
    """

    counts: tuple[int, ...]
    button: bool = False
    calibrate: bool = False
    number: int = 0


@dataclass(frozen=True, slots=True)
class SetCounters:
    """Command that the counters hold these counts from now on, and no current; of the newer kind only."""

    counts: tuple[int, int, int, int, int, int]


def decode_sensors(report: bytes) -> Sensors:
    """Raises ValueError for a report of another length."""
    if len(report) == LONG:
        *counts, info = _LONG.unpack(report)
        pressed = counts[3] > BUTTON_ABOVE
        if pressed:
            counts[3] -= BUTTON_OFFSET
        return Sensors(tuple(counts), pressed, info == 1)
    if len(report) == SHORT:
        *counts, number = _SHORT.unpack(report)
        return Sensors(tuple(counts), number=number)
    raise ValueError(f"expected a report of {LONG} or {SHORT} bytes, got {len(report)}")


def encode_sensors(sensors: Sensors) -> bytes:
    """Counts beyond 16 bits lose their upper ones, as in the device."""
    counts = [wrapped(count) for count in sensors.counts]
    if len(counts) == 3:
        return _SHORT.pack(*counts, sensors.number & 0xFFFF)
    if sensors.button:
        counts[3] = wrapped(counts[3] + BUTTON_OFFSET)
    return _LONG.pack(*counts, int(sensors.calibrate))


def encode_command(command: Currents | SetCounters, size: int, number: int = 0) -> bytes:
    """A report of `size` bytes, without the report number that hidapi wants in front.

    Args:
        command: currents [mA] within 16 bits, or counters to set.
        size: `LONG` or `SHORT`.
        number: of the report; goes into the older kind only.

    Raises:
        ValueError: if the older kind is to set counters, or there is no such kind.
    """
    if size == SHORT and not isinstance(command, SetCounters):
        return _SHORT.pack(*command, number & 0xFFFF)
    if size != LONG:
        raise ValueError(f"expected a report of {LONG} bytes, got {size} for {command}")
    if isinstance(command, SetCounters):
        a, b, c, d, e, f = map(wrapped, command.counts)
        return _LONG.pack(d, e, f, SET_COUNTERS, a, b, c)
    return _LONG.pack(*command, CURRENTS, 0, 0, 0)


def decode_command(report: bytes) -> Currents | SetCounters:
    """As the device understands it: whatever is not command 1 is currents. Raises ValueError for another length."""
    if len(report) == SHORT:
        a, b, c, _ = _SHORT.unpack(report)
        return (a, b, c)
    if len(report) != LONG:
        raise ValueError(f"expected a report of {LONG} or {SHORT} bytes, got {len(report)}")
    d, e, f, command, a, b, c = _LONG.unpack(report)
    return SetCounters((a, b, c, d, e, f)) if command == SET_COUNTERS else (d, e, f)


def wrapped(count: int) -> int:
    """The lower 16 bits of a count, as a signed number."""
    return (count + 0x8000 & 0xFFFF) - 0x8000


class Unwrapper:
    """Extends counts of 16 bits; correct while none moves by 32768 or more between two reports."""

    def __init__(self) -> None:
        self._counts: tuple[int, ...] | None = None

    def unwrap(self, counts: tuple[int, ...]) -> tuple[int, ...]:
        """The first counts after `reset` are taken as they are."""
        if self._counts is None:
            self._counts = counts
        else:
            self._counts = tuple(
                before + wrapped(now - before) for before, now in zip(self._counts, counts, strict=True)
            )
        return self._counts

    def reset(self) -> None:
        self._counts = None


NO_CURRENT: Currents = (0, 0, 0)


class ReportPort(Protocol):
    """The part of `HidPort` that a `HidLine` uses."""

    def write(self, report: bytes) -> None: ...

    def read_all(self, until: float) -> list[bytes]: ...

    def guard(self, guardian: Guardian) -> None: ...

    def close(self) -> None: ...


class HidLine:
    """An open device; see `lock_step.MessageLine`.

    Args:
        path: of the device.
        connect: opens it.

    Raises:
        HardwareFault: it cannot be opened.
    """

    def __init__(self, path: str, connect: Callable[[str], ReportPort] = HidPort) -> None:
        self._port = connect(path)
        self._number = 0
        self.size = LONG
        """Bytes in a report of this device, as `find_size` found."""

    def send(self, message: Currents | SetCounters) -> None:
        self._number += 1
        self._port.write(encode_command(message, self.size, self._number))

    def hear(self, until: float) -> list[Sensors | None]:
        return [decode_sensors(report) if len(report) == self.size else None for report in self._port.read_all(until)]

    def find_size(self, clock: Callable[[], float], patience: float, pause: float) -> None:
        """Find the kind of device from the size of its first report, whose contents may be old.

        Where none comes, zeros set a device in motion that waits for its host.

        Args:
            clock: monotonic [s].
            patience: how long to try [s].
            pause: how long to wait for a report [s].

        Raises:
            HardwareFault: no report comes, or one of another length.
        """
        gives_up = clock() + patience
        while not (reports := self._port.read_all(clock() + pause)):
            if clock() > gives_up:
                raise HardwareFault("sends no reports; unplug it and plug it in again")
            self.send(NO_CURRENT)
        size = len(reports[-1])
        if size not in (LONG, SHORT):
            raise HardwareFault(f"sends reports of {size} bytes, expected {LONG} or {SHORT}: it is no such device")
        self.size = size

    def guard(self, guardian: Guardian) -> None:
        """Start the guardian, which takes the currents off when this process stops; the size must be known."""
        guardian.zero = b"\0" + encode_command(NO_CURRENT, self.size)
        guardian.rests = (guardian.zero[:7],)  # the number of the report, and the currents
        self._port.guard(guardian)

    def close(self) -> None:
        self._port.close()
