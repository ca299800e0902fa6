"""`polhem_hid`: WoodenHaptics and Polhem with an mbed board, on USB HID."""

from collections.abc import Sequence
from math import inf
from typing import Any, ClassVar

from weberlink.hardware.discovery import PluggedDevice, UsbId, hid_devices
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.guardian import Guardian
from weberlink.hardware.hid_port import HidPort
from weberlink.master.devices.polhem.driver import OPENING_S, PolhemDevice, PolhemExchange
from weberlink.master.devices.polhem.lock_step import REPLY_S, SILENT
from weberlink.master.devices.polhem.parameters import PolhemHidOptions
from weberlink.master.devices.polhem.protocol import (
    HID_WATCHDOG_S,
    LONG,
    NO_CURRENT,
    SHORT,
    Counts,
    Message,
    Sensors,
    SetCounters,
    decode_sensors,
    encode_command,
    unwrapped,
)

USAGE_PAGE = 0xFFAB
UNREPORTED = 0
SET_WITHIN_COUNTS = 100  # largest motion of a held handle while the counters are set


class ReportExchange(PolhemExchange):
    """Speaks HID reports.

    A report of 14 bytes answers the one before it: the first after opening may be old. The older kind of device sends
    at its own rate, and the newest report after a message counts.
    """

    NAME = "polhem_hid"
    WATCHDOG_S = HID_WATCHDOG_S

    def __init__(self, options: PolhemHidOptions, force_n: float, *others: Any) -> None:
        super().__init__(options, force_n, *others)
        # The board's own watchdog is slow.
        self.guardian = Guardian(b"") if force_n > 0.0 else None
        self._is_short = options.report_bytes == SHORT
        self._unwrapped: Counts | None = None

    def start_afresh(self) -> None:
        super().start_afresh()
        self._unwrapped = None

    def send(self, message: Message) -> None:
        self._number += 1
        self._port.write(encode_command(message, self._size, self._number))

    def hear(self, until: float) -> Sequence[Sensors | None]:
        reports = self._port.read_all(until)
        return [decode_sensors(report) if len(report) == self._size else None for report in reports]

    def ask(self, message: Message, fresh_until: float = inf) -> Sensors:
        if self._in_lock_step:
            return super().ask(message, fresh_until)
        self.hear(0.0)  # drop what is older
        self.send(message if self._clock() <= fresh_until else NO_CURRENT)
        answers = self.hear(self._clock() + REPLY_S)
        if not answers or answers[-1] is None:
            raise BadReply(SILENT)
        return answers[-1]

    def _connect(self, path: str) -> None:
        """Find the kind of device from the size of its first report, whose contents may be old."""
        self._in_lock_step, self._size, self._number = False, LONG, 0
        gives_up = self._clock() + OPENING_S
        while not (reports := self._port.read_all(self._clock() + REPLY_S)):
            if self._clock() > gives_up:
                raise HardwareFault("sends no reports; unplug it and plug it in again")
            self.send(NO_CURRENT)  # sets a device in motion that waits for its host
        size, expected = len(reports[-1]), self._options.report_bytes
        if size not in (LONG, SHORT):
            raise HardwareFault(f"sends reports of {size} bytes, expected {LONG} or {SHORT}: it is no such device")
        self._size = size
        if size != expected:
            raise HardwareFault(
                f"sends reports of {size} bytes, the file says {expected}; their signs differ: set "
                f"master.device.report_bytes: {size} and check the signs"
            )
        if self.guardian is not None and path.startswith("/"):  # else by libusb, where nobody else can write
            zero = b"\0" + encode_command(NO_CURRENT, size)
            self.guardian.zero, self.guardian.rests = zero, (zero[:7],)  # the number of the report, and the currents
            self._port.guard(self.guardian)
        self._in_lock_step = not self._is_short

    def _home_counts(self) -> Counts:
        size = 3 if self._is_short else 6
        if not self._options.counters_hold_home:
            return (0,) * size
        wiring = self._mechanism.wiring
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
        self._await_press(lambda _, now: now.calibrate)
        self._home_here(self._home_counts())

    def _set_counters(self, counts: Counts) -> Sensors:
        self._unwrapped = None
        return self._insist(SetCounters(counts))

    def _continuous(self, sensors: Sensors) -> Counts:
        self._unwrapped = unwrapped(sensors.counts, self._unwrapped)
        return self._ordered(self._unwrapped)

    def _ordered(self, counts: Counts) -> Counts:
        """Between the order of the counters and that of the gimbal's axes, either way."""
        if len(counts) == 6 and self._mechanism.gimbal_reversed_over_hid:
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
