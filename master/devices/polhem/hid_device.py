"""`polhem_hid`: WoodenHaptics and Polhem with an mbed board, on USB HID."""

from collections.abc import Callable
from contextlib import suppress
from math import inf
from time import monotonic
from typing import ClassVar

from weberlink.hardware.discovery import PluggedDevice, UsbId, hid_devices
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.guardian import Guardian
from weberlink.hardware.hid_port import HidPort
from weberlink.master.devices.polhem.driver import NO_CURRENT, OPENING_S, REPLY_S, PolhemDevice, PolhemExchange
from weberlink.master.devices.polhem.hid_protocol import (
    SHORT,
    WATCHDOG_S,
    Currents,
    HidLine,
    ReportPort,
    Sensors,
    SetCounters,
    Unwrapper,
)
from weberlink.master.devices.polhem.homing import PositionValidator, await_press
from weberlink.master.devices.polhem.lock_step import LockStep
from weberlink.master.devices.polhem.options import PolhemHidOptions, signs_fingerprint
from weberlink.registry import Tier

NAME = "polhem_hid"
USAGE_PAGE = 0xFFAB
UNREPORTED = 0

SET_WITHIN_COUNTS = 100
"""Largest motion of a held handle while the counters are set."""


class ReportExchange(PolhemExchange):
    """Speaks HID reports; the board's watchdog switches the motors off after 0.5 s without a report.

    A report of 14 bytes answers the one before it: the first after opening may be old. The older kind of device sends
    at its own rate, and the newest report counts.

    Args:
        options: of the driver.
        force_n: largest force [N]; 0 for never a current, and no guardian.
        connect: opens the device at a path.
    """

    def __init__(
        self, options: PolhemHidOptions, force_n: float, connect: Callable[[str], ReportPort] = HidPort
    ) -> None:
        super().__init__(NAME, options, force_n, PolhemHidDevice.plugged)
        # The board's own watchdog is slow.
        self.guardian = Guardian(b"") if force_n > 0.0 else None
        self._hid_options = options
        self._wired = self._parameters = options.wired()
        self._open_port = connect
        self._line: HidLine | None = None
        self._dialogue: LockStep[Currents | SetCounters, Sensors] | None = None
        self._unwrapper = Unwrapper()

    def start_afresh(self) -> None:
        super().start_afresh()
        self._unwrapper.reset()

    def close(self) -> None:
        line = self._line
        if line is not None:
            with suppress(HardwareFault):
                self._ask(NO_CURRENT)
            self._line = None
            line.close()

    def _connect(self, path: str) -> None:
        self._line, self._dialogue = HidLine(path, self._open_port), None
        self._line.find_size(monotonic, OPENING_S, REPLY_S)
        size, expected = self._line.size, self._hid_options.report_bytes
        if size != expected:
            raise HardwareFault(
                f"sends reports of {size} bytes, the file says {expected}; their signs differ: set "
                f"master.device.report_bytes: {size} and check the signs"
            )
        if self.guardian is not None and path.startswith("/"):  # else by libusb, where nobody else can write
            self._line.guard(self.guardian)
        self._dialogue = None if size == SHORT else LockStep(self._line, NO_CURRENT)

    def _ask(self, command: Currents | SetCounters, fresh_until: float = inf) -> Sensors:
        """One report out and one in; raises BadReply where none comes in time. `fresh_until`: see `LockStep.ask`."""
        if self._dialogue is not None:
            return self._dialogue.ask(command, REPLY_S, fresh_until)
        line = self._line
        assert line is not None
        line.hear(0.0)  # drop older reports
        line.send(command if monotonic() <= fresh_until else NO_CURRENT)
        reports = line.hear(monotonic() + REPLY_S)
        if not reports or reports[-1] is None:
            raise BadReply("does not answer")
        return reports[-1]

    def _measure(self, currents: Currents, fresh_until: float = inf) -> tuple[tuple[int, ...], int]:
        sensors = self._ask(currents, fresh_until)
        return self._continuous(sensors), int(sensors.button)

    def _home(self) -> PositionValidator:
        homing, home = self._options.homing, self._home_counts()
        validator = PositionValidator(self._wired, home)
        if homing == "power_up":
            return validator
        sensors = self._insist(lambda: self._ask(NO_CURRENT))
        if homing == "button":
            self._await_button(sensors)
        if self._is_short:
            here = self._continuous(sensors)
            return PositionValidator(self._wired, tuple(count - held for count, held in zip(here, home, strict=True)))
        here = self._continuous(self._set_counters(self._ordered(home)))
        if max(abs(count - held) for count, held in zip(here[:3], home[:3], strict=True)) > SET_WITHIN_COUNTS:
            raise HardwareFault("does not set its counters when it is told to; set homing: power_up")
        return validator

    def _await_button(self, sensors: Sensors) -> None:
        if self._is_short:
            raise HardwareFault("is a board with 8-byte reports, without a calibration button; set homing: at_open")
        if sensors.calibrate:  # pressed some time ago, wherever the handle was then
            self._set_counters(sensors.counts)
        await_press(lambda: self._ask(NO_CURRENT), lambda _, now: now.calibrate, self._options.home_patience_s)

    def _set_counters(self, counts: tuple[int, ...]) -> Sensors:
        a, b, c, d, e, f = counts
        self._unwrapper.reset()
        return self._insist(lambda: self._ask(SetCounters((a, b, c, d, e, f))))

    @property
    def _is_short(self) -> bool:
        return self._hid_options.report_bytes == SHORT

    def _home_counts(self) -> tuple[int, ...]:
        """Contents of the counters in the home pose."""
        size = 3 if self._is_short else 6
        if not self._hid_options.counters_hold_home:
            return (0,) * size
        drive = self._wired.mechanism.drive
        return (*drive.home_counts, *drive.gimbal_home_counts)[:size]

    def _continuous(self, sensors: Sensors) -> tuple[int, ...]:
        """Counts without wrapping, those of the gimbal in the order of its axes."""
        return self._ordered(self._unwrapper.unwrap(sensors.counts))

    def _ordered(self, counts: tuple[int, ...]) -> tuple[int, ...]:
        """Between the order of the counters and that of the gimbal's axes, either way."""
        if len(counts) == 6 and self._wired.gimbal_reversed_over_hid:
            return (*counts[:3], *counts[:2:-1])
        return counts


class PolhemHidDevice(PolhemDevice):
    """14-byte reports in lock-step, or the older ones of 8 bytes; the length that the options say is checked.

    Without a report for 0.5 s the device itself switches its motors off; it has no other limit.
    """

    TIER: ClassVar[Tier] = "emulated only"
    Options = PolhemHidOptions
    USB: ClassVar[tuple[UsbId, ...]] = (UsbId(0x1234, 0x0006),)

    def __init__(self, options: PolhemHidOptions, tick_period: float) -> None:
        super().__init__(
            NAME,
            options,
            options.wired(),
            lambda force_n: ReportExchange(options, force_n),
            tick_period,
            signs=self.fingerprint(options),
            watchdog_s=WATCHDOG_S,
            buttons=1,
        )

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        return hid_devices(cls.USB, (USAGE_PAGE, UNREPORTED))

    @classmethod
    def fingerprint(cls, options: PolhemHidOptions) -> str:
        """Fingerprint of the settings that a sign check holds for."""
        return signs_fingerprint(f"{NAME} {options.report_bytes}", options.wired())
