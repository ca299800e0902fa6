"""`polhem_hid`: WoodenHaptics and Polhem with an mbed board, on USB HID."""

from collections.abc import Callable
from contextlib import suppress
from math import inf
from time import monotonic
from typing import ClassVar

from weberlink.geometry.vector import ZERO, Vector
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.found import Found, UsbId, hid_devices
from weberlink.hardware.guardian import Guardian
from weberlink.master.devices.contract import DeviceReading
from weberlink.master.devices.polhem.force_stage import ForceStage
from weberlink.master.devices.polhem.hid_line import NO_CURRENT, HidLine, HidReports, ReportPort
from weberlink.master.devices.polhem.homing import await_press
from weberlink.master.devices.polhem.identity import Identity, located
from weberlink.master.devices.polhem.lock_step import LockStep
from weberlink.master.devices.polhem.options import PolhemHidOptions
from weberlink.master.devices.polhem.parameters import Parameters
from weberlink.master.devices.polhem.polhem_device import CARRY_S, STALL_S, PolhemDevice, spec_of
from weberlink.master.devices.polhem.reports import SHORT, WATCHDOG_S, Currents, Sensors, SetCounters, Unwrapper
from weberlink.master.devices.polhem.sign_check import fingerprint
from weberlink.master.devices.polhem.whereabouts import Whereabouts

NAME = "polhem_hid"
USAGE_PAGE = 0xFFAB
UNREPORTED = 0

REPORT_S = 0.01
OPENING_S = 0.5
"""How long a device may take until its reports are good [s]."""

SET_WITHIN_COUNTS = 100
"""A hand that holds the handle still does not move it farther while the counters are set."""


class ReportExchange:
    """One report out, one in. The device's own watchdog (0.5 s) is fed by every exchange.

    A report of 14 bytes is the answer to the one before it: the first after opening may be of long ago. The older kind
    of device sends at its own rate, and the newest report is taken.

    Args:
        options: of the driver.
        parameters: of the mechanism.
        force_n: largest force [N]; 0 for never a current.
        connect: opens the device at a path.
    """

    def __init__(
        self,
        options: PolhemHidOptions,
        parameters: Parameters,
        force_n: float,
        connect: Callable[[str], ReportPort] = HidReports,
    ) -> None:
        # The board's own watchdog is slow.
        self.guardian = Guardian(b"") if force_n > 0.0 else None
        self._options = options
        self._parameters = parameters
        self._connect = connect
        self._stage = ForceStage(
            parameters.mechanism, force_n, options.max_current_ma, carry=options.gravity_compensation
        )
        self._identity = Identity(NAME, options.port, PolhemHidDevice.plugged)
        self._line: HidLine | None = None
        self._talk: LockStep[Currents | SetCounters, Sensors] | None = None
        self._unwrapper = Unwrapper()
        self._whereabouts: Whereabouts | None = None
        self._relative: tuple[int, ...] = ()
        self._asked_at = 0.0
        self._force_from = 0.0
        self.commanded_at = 0.0
        self.orientation_trouble: str | None = None

    def start_afresh(self) -> None:
        self._identity.forget()
        self._whereabouts = None
        self._unwrapper.reset()

    def open(self) -> DeviceReading:
        path = self._identity.locate()
        self._line, self._talk = HidLine(path, self._connect), None
        try:
            self._line.find_size(monotonic, OPENING_S, REPORT_S)
            self._check_kind(self._line.size)
            if self.guardian is not None and path.startswith("/"):  # else by libusb, where nobody else can write
                self._line.guard(self.guardian)
            self._talk = None if self._line.size == SHORT else LockStep(self._line, NO_CURRENT)
            if self._whereabouts is None:
                self._whereabouts = Whereabouts(self._parameters, self._home_counts())
                self._home(self._whereabouts)
            self._asked_at = self._force_from = asked = monotonic()
            counts = self._counts(self._insist(NO_CURRENT))
            reading = self._whereabouts.begin(counts, asked, monotonic())
        except HardwareFault as fault:
            self.close()  # the next attempt could not open it otherwise
            raise located(path, fault) from None
        self._relative = self._whereabouts.relative(counts)
        return reading

    def exchange(self, command: Vector) -> DeviceReading:
        assert self._whereabouts is not None
        asked, currents = monotonic(), NO_CURRENT
        if asked - self._asked_at > STALL_S:
            self._force_from = asked
        self._asked_at = asked
        carry = self._options.gravity_compensation and asked - self.commanded_at < CARRY_S
        if carry or command != ZERO:
            currents = self._stage.currents_ma(command, self._relative, asked - self._force_from)
        sensors = self._ask(currents, asked + STALL_S)
        counts = self._counts(sensors)
        reading = self._whereabouts.next(counts, asked, monotonic(), int(sensors.button))
        self._relative = self._whereabouts.relative(counts)
        return reading

    def close(self) -> None:
        line = self._line
        if line is not None:
            with suppress(HardwareFault):
                self._ask(NO_CURRENT)
            self._line = None
            line.close()

    def _ask(self, command: Currents | SetCounters, fresh_until: float = inf) -> Sensors:
        """One report out and one in; raises BadReply where none comes in time. `fresh_until`: see `LockStep.ask`."""
        if self._talk is not None:
            return self._talk.ask(command, REPORT_S, fresh_until)
        line = self._line
        assert line is not None
        line.hear(0.0)  # of before
        line.send(command if monotonic() <= fresh_until else NO_CURRENT)
        reports = line.hear(monotonic() + REPORT_S)
        if not reports or reports[-1] is None:
            raise BadReply("does not answer")
        return reports[-1]

    def _insist(self, command: Currents | SetCounters) -> Sensors:
        """As `_ask`, for as long as it may take a device to begin."""
        until = monotonic() + OPENING_S
        while True:
            try:
                return self._ask(command)
            except BadReply:
                if monotonic() > until:
                    raise

    def _check_kind(self, size: int) -> None:
        expected = self._options.report_bytes
        if size != expected:
            raise HardwareFault(
                f"sends reports of {size} bytes, the file says {expected}; their signs differ: set "
                f"master.device.report_bytes: {size} and check the signs"
            )

    def _home(self, whereabouts: Whereabouts) -> None:
        homing = self._options.homing
        if homing == "power_up":
            return
        sensors = self._insist(NO_CURRENT)
        if homing == "button":
            self._await_button(sensors)
        home = self._home_counts()
        if self._is_short:
            here = self._counts(sensors)
            whereabouts.home(tuple(count - held for count, held in zip(here, home, strict=True)))
            return
        here = self._counts(self._set_counters(self._ordered(home)))
        if max(abs(count - held) for count, held in zip(here[:3], home[:3], strict=True)) > SET_WITHIN_COUNTS:
            raise HardwareFault("does not set its counters when it is told to; set homing: power_up")

    def _await_button(self, sensors: Sensors) -> None:
        if self._is_short:
            raise HardwareFault("is of the older kind, without a calibration button; set homing: at_open")
        if sensors.calibrate:  # pressed some time ago, wherever the handle was then
            self._set_counters(sensors.counts)
        await_press(lambda: self._ask(NO_CURRENT), lambda _, now: now.calibrate, self._options.home_patience_s)

    def _set_counters(self, counts: tuple[int, ...]) -> Sensors:
        a, b, c, d, e, f = counts
        self._unwrapper.reset()
        return self._insist(SetCounters((a, b, c, d, e, f)))

    @property
    def _is_short(self) -> bool:
        return self._line is not None and self._line.size == SHORT

    def _home_counts(self) -> tuple[int, ...]:
        """What the counters hold in the home pose."""
        size = 3 if self._is_short else 6
        if not self._options.counters_hold_home:
            return (0,) * size
        drive = self._parameters.mechanism.drive
        return (*drive.home_counts, *drive.gimbal_home_counts)[:size]

    def _counts(self, sensors: Sensors) -> tuple[int, ...]:
        """Without wrapping, and the gimbal's in the order of its axes."""
        return self._ordered(self._unwrapper.unwrap(sensors.counts))

    def _ordered(self, counts: tuple[int, ...]) -> tuple[int, ...]:
        """Between the order of the counters and that of the gimbal's axes, either way."""
        if len(counts) == 6 and self._parameters.gimbal_reversed_over_hid:
            return (*counts[:3], *counts[:2:-1])
        return counts


class PolhemHidDevice(PolhemDevice):
    """14-byte reports in lock-step, or the older ones of 8 bytes; what the file says is checked.

    Without a report for 0.5 s the device itself switches its motors off; it has no other limit.
    """

    Options = PolhemHidOptions
    USB: ClassVar[tuple[UsbId, ...]] = (UsbId(0x1234, 0x0006),)

    def __init__(self, options: PolhemHidOptions, tick_period: float) -> None:
        """Raises ValueError where the options ask for more than the makers publish."""
        parameters = options.wired()
        spec = spec_of(
            NAME,
            options,
            parameters,
            tick_period,
            signs=self.fingerprint(options),
            watchdog_s=WATCHDOG_S,
            buttons=1,
        )
        exchange = ReportExchange(options, parameters, spec.force_n)
        super().__init__(spec, exchange, tick_period, options.reconnect_s)

    @classmethod
    def plugged(cls) -> list[Found]:
        return hid_devices(cls.USB, (USAGE_PAGE, UNREPORTED))

    @classmethod
    def fingerprint(cls, options: PolhemHidOptions) -> str:
        """Of the settings that a sign check is good for."""
        return fingerprint(f"{NAME} {options.report_bytes}", options.wired())
