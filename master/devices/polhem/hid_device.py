"""`polhem_hid`: WoodenHaptics and Polhem with an mbed board, on USB HID."""

from collections.abc import Sequence
from time import monotonic
from typing import Any, ClassVar

from weberlink.hardware.discovery import PluggedDevice, UsbId, hid_devices
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.guardian import Guardian
from weberlink.hardware.hid_port import HidPort
from weberlink.master.devices.polhem.driver import OPENING_S, REPLY_S, PolhemDevice, PolhemExchange
from weberlink.master.devices.polhem.homing import Counts, await_press
from weberlink.master.devices.polhem.lock_step import FreeRunning, Line, LockStep
from weberlink.master.devices.polhem.options import PolhemHidOptions
from weberlink.master.devices.polhem.protocol import (
    HID_WATCHDOG_S,
    LONG,
    NO_CURRENT,
    SHORT,
    Message,
    Sensors,
    SetCounters,
    Unwrapper,
    decode_sensors,
    encode_command,
)

USAGE_PAGE = 0xFFAB
UNREPORTED = 0
SET_WITHIN_COUNTS = 100  # largest motion of a held handle while the counters are set


class HidLine(Line):
    """An open `HidPort`."""

    def __init__(self, port: Any) -> None:
        self._port = port
        self._number = 0
        self.size = LONG  # bytes in a report of this device, as `find_size` found

    def find_size(self) -> None:
        """Find the kind of device from the size of its first report, whose contents may be old; raises HardwareFault if
        no report comes, or one of another length.
        """
        gives_up = monotonic() + OPENING_S
        while not (reports := self._port.read_all(monotonic() + REPLY_S)):
            if monotonic() > gives_up:
                raise HardwareFault("sends no reports; unplug it and plug it in again")
            self.send(NO_CURRENT)  # sets a device in motion that waits for its host
        size = len(reports[-1])
        if size not in (LONG, SHORT):
            raise HardwareFault(f"sends reports of {size} bytes, expected {LONG} or {SHORT}: it is no such device")
        self.size = size

    def send(self, message: Message) -> None:
        self._number += 1
        self._port.write(encode_command(message, self.size, self._number))

    def hear(self, until: float) -> Sequence[Sensors | None]:
        return [decode_sensors(report) if len(report) == self.size else None for report in self._port.read_all(until)]

    def guard(self, guardian: Guardian) -> None:
        """Start the guardian, which takes the currents off when this process stops."""
        guardian.zero = b"\0" + encode_command(NO_CURRENT, self.size)
        guardian.rests = (guardian.zero[:7],)  # the number of the report, and the currents
        self._port.guard(guardian)

    def close(self) -> None:
        self._port.close()


class ReportExchange(PolhemExchange):
    """Speaks HID reports.

    A report of 14 bytes answers the one before it: the first after opening may be old. The older kind of device sends
    at its own rate, and the newest report counts.
    """

    NAME = "polhem_hid"
    WATCHDOG_S = HID_WATCHDOG_S

    def __init__(self, options: PolhemHidOptions, force_n: float, *others: Any) -> None:
        super().__init__(options, force_n, *others)
        # The board's own watchdog is slow.
        self.guardian = Guardian(b"") if force_n > 0.0 else None
        self._is_short = options.report_bytes == SHORT
        self._unwrapper = Unwrapper()

    def start_afresh(self) -> None:
        super().start_afresh()
        self._unwrapper.reset()

    def _connect(self, path: str) -> None:
        line = HidLine(self._open_port(path))
        self._dialogue = FreeRunning(line)
        line.find_size()
        expected = self._options.report_bytes
        if line.size != expected:
            raise HardwareFault(
                f"sends reports of {line.size} bytes, the file says {expected}; their signs differ: set "
                f"master.device.report_bytes: {line.size} and check the signs"
            )
        if self.guardian is not None and path.startswith("/"):  # else by libusb, where nobody else can write
            line.guard(self.guardian)
        if not self._is_short:
            self._dialogue = LockStep(line)

    def _home_counts(self) -> Counts:
        size = 3 if self._is_short else 6
        if not self._options.counters_hold_home:
            return (0,) * size
        wiring = self._parameters.mechanism.drive.wiring
        return (*wiring.home_counts, *wiring.gimbal_home_counts)[:size]

    def _home_here(self, home: Counts) -> Counts:
        if self._is_short:
            return super()._home_here(home)
        self._insist(NO_CURRENT)  # the first answer may be old
        here = self._continuous(self._set_counters(self._ordered(home)))
        if max(abs(count - held) for count, held in zip(here[:3], home[:3], strict=True)) > SET_WITHIN_COUNTS:
            raise HardwareFault("does not set its counters when it is told to; set homing: power_up")
        return home

    def _await_button(self) -> None:
        if self._is_short:
            raise HardwareFault("is a board with 8-byte reports, without a calibration button; set homing: at_open")
        sensors = self._insist(NO_CURRENT)
        if sensors.calibrate:  # pressed some time ago, wherever the handle was then
            self._set_counters(sensors.counts)
        await_press(lambda: self._ask(NO_CURRENT), lambda _, now: now.calibrate, self._options.home_patience_s)
        self._home_here(self._home_counts())

    def _set_counters(self, counts: Counts) -> Sensors:
        a, b, c, d, e, f = counts
        self._unwrapper.reset()
        return self._insist(SetCounters((a, b, c, d, e, f)))

    def _continuous(self, sensors: Sensors) -> Counts:
        return self._ordered(self._unwrapper.unwrap(sensors.counts))

    def _ordered(self, counts: Counts) -> Counts:
        """Between the order of the counters and that of the gimbal's axes, either way."""
        if len(counts) == 6 and self._parameters.gimbal_reversed_over_hid:
            return (*counts[:3], *counts[:2:-1])
        return counts


class PolhemHidDevice(PolhemDevice):
    """14-byte reports in lock-step, or the older ones of 8 bytes; the length that the options say is checked."""

    Options = PolhemHidOptions
    EXCHANGE = ReportExchange
    PORT = HidPort
    KIND = "report_bytes"
    BUTTONS = 1
    USB: ClassVar[tuple[UsbId, ...]] = (UsbId(0x1234, 0x0006),)

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        return hid_devices(cls.USB, (USAGE_PAGE, UNREPORTED))
