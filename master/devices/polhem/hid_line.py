"""The reports of either kind on a HID port: commands go out, sensors come in."""

from collections.abc import Callable, Sequence
from time import monotonic
from typing import Protocol

from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.guardian import Guardian
from weberlink.hardware.hid_port import HidPort
from weberlink.master.devices.polhem.reports import (
    LONG,
    SHORT,
    Currents,
    Sensors,
    SetCounters,
    decode_sensors,
    encode_command,
)

LONGEST_REPORT = 64
NO_CURRENT: Currents = (0, 0, 0)


class ReportPort(Protocol):
    """What is needed of `HidReports`."""

    def write(self, report: bytes) -> None: ...

    def read_all(self, until: float) -> list[bytes]: ...

    def guard(self, guardian: Guardian) -> None: ...

    def close(self) -> None: ...


class HidHandle(Protocol):
    """What is needed of a device of hidapi that is set not to block."""

    def read(self, size: int, timeout_ms: int = 0, /) -> Sequence[int]:
        """One report, the oldest that waits; nothing where none comes in time."""
        ...


class HidReports(HidPort):
    """A HID port that drops nothing: where every report has its answer, they have to be counted."""

    def read_all(self, until: float) -> list[bytes]:
        """As `all_reports`.

        Raises:
            HardwareFault: it was unplugged.
        """
        try:
            return all_reports(self._device, until)
        except (OSError, ValueError):
            raise HardwareFault(f"{self.path}: unplugged") from None


def all_reports(device: HidHandle, until: float) -> list[bytes]:
    """All reports that have come, as soon as there are any; none where none comes by `until` [s, monotonic].

    Args:
        device: set not to block.
        until: 0 for not to wait.
    """
    reports = _waiting(device)
    if reports or until == 0.0:
        return reports
    # A timeout of 0 ms would mean to wait without end.
    first = device.read(LONGEST_REPORT, max(1, round((until - monotonic()) * 1e3)))
    return [bytes(first), *_waiting(device)] if first else []


def _waiting(device: HidHandle) -> list[bytes]:
    reports = []
    while report := device.read(LONGEST_REPORT):
        reports.append(bytes(report))
    return reports


class HidLine:
    """An open device; see `lock_step.Line`.

    Args:
        path: of the device.
        connect: opens it.

    Raises:
        HardwareFault: it cannot be opened.
    """

    def __init__(self, path: str, connect: Callable[[str], ReportPort] = HidReports) -> None:
        self._port = connect(path)
        self._number = 0
        self.size = LONG
        """Bytes in a report of this device; to be set to what `first_report` found."""

    def send(self, message: Currents | SetCounters) -> None:
        self._number += 1
        self._port.write(encode_command(message, self.size, self._number))

    def hear(self, until: float) -> list[Sensors | None]:
        return [decode_sensors(report) if len(report) == self.size else None for report in self._port.read_all(until)]

    def find_size(self, clock: Callable[[], float], patience: float, pause: float) -> None:
        """Learn from the first report which kind of device it is; what it says may be of long ago.

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
        """Have the currents taken off when this process stops; once the size is known."""
        guardian.zero = b"\0" + encode_command(NO_CURRENT, self.size)
        guardian.rests = (guardian.zero[:7],)  # the number of the report, and the currents
        self._port.guard(guardian)

    def close(self) -> None:
        self._port.close()
