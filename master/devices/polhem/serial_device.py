"""`polhem_serial`: Polhem, SensAble PHANTOM with new electronics, or WoodenHaptics, on a Teensy's serial port."""

from contextlib import suppress
from math import inf
from pathlib import Path
from typing import ClassVar

from weberlink.hardware.discovery import PluggedDevice, UsbId, serial_ports
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.master.devices.polhem.driver import NO_CURRENT, REPLY_S, PolhemDevice, PolhemExchange
from weberlink.master.devices.polhem.homing import PositionValidator, await_press, zeroed
from weberlink.master.devices.polhem.lock_step import LockStep
from weberlink.master.devices.polhem.options import PolhemSerialOptions, signs_fingerprint
from weberlink.master.devices.polhem.serial_protocol import (
    GIMBAL_ERRORS,
    MODELS,
    WATCHDOG_S,
    Currents,
    SerialLine,
    SerialStatus,
    complaint,
)
from weberlink.registry import Tier

NAME = "polhem_serial"

SENSORS = 3
"""Sensors of the gimbal, of which the firmware reads one per message."""

REPORTS = "reports"
STRANGER = ": it is no such device, or its firmware is older than 2.0; `weberlink device list` lists what there is"

PORTS_BY_ID = Path("/dev/serial/by-id")


class BracketExchange(PolhemExchange):
    """Speaks the bracket protocol; the board's watchdog switches the motors off after 100 ms without a message."""

    def __init__(self, options: PolhemSerialOptions, force_n: float) -> None:
        super().__init__(NAME, options, force_n, PolhemSerialDevice.plugged)
        self._serial_options = options
        self._line: SerialLine | None = None
        self._dialogue: LockStep[Currents, SerialStatus] | None = None
        self._model: int | None = None
        self._gimbal_doubted = 0
        self._gimbal_complaint = ""

    def close(self) -> None:
        line, self._line = self._line, None
        if line is not None:
            with suppress(HardwareFault):
                self._ask(NO_CURRENT)
            line.close()

    @property
    def orientation_trouble(self) -> str | None:
        return self._gimbal_complaint if self._gimbal_doubted else None

    def _connect(self, path: str) -> None:
        self._line = SerialLine(path)
        self._dialogue = LockStep(self._line, NO_CURRENT)
        model = self._first_status().model
        if self._validator is None:
            self._check_model(model)
        elif model != self._model:
            raise HardwareFault(f"came back as another one: {_described(model)}, not {_described(self._model)}")

    def _ask(self, currents: Currents, fresh_until: float = inf) -> SerialStatus:
        """One round trip; raises BadReply for an error of the message, since the currents were not applied then.

        A sensor of the gimbal that cannot be read comes after the currents were applied, and leaves the main counts
        good. The firmware reads one sensor per message, so all three are good again after three answers without error.
        """
        assert self._dialogue is not None
        status = self._dialogue.ask(currents, REPLY_S, fresh_until)
        if status.error & GIMBAL_ERRORS:
            self._gimbal_complaint = complaint(status.error & GIMBAL_ERRORS)
        if status.error & GIMBAL_ERRORS or (status.error and self._gimbal_doubted):
            self._gimbal_doubted = SENSORS
        elif status.error == 0:
            self._gimbal_doubted = max(0, self._gimbal_doubted - 1)
        if status.error & ~GIMBAL_ERRORS:
            raise BadReply(f"{REPORTS} {complaint(status.error)}")
        return status

    def _measure(self, currents: Currents, fresh_until: float = inf) -> tuple[tuple[int, ...], int]:
        return self._ask(currents, fresh_until).counts, 0

    def _first_status(self) -> SerialStatus:
        try:
            return self._insist(lambda: self._ask(NO_CURRENT))
        except BadReply as reply:
            raise HardwareFault(f"{reply}{'' if str(reply).startswith(REPORTS) else STRANGER}") from None

    def _check_model(self, model: int) -> None:
        """Take the parameters of the model that answered, if it is the expected one."""
        expected = self._serial_options.model
        if model not in MODELS:
            known = ", ".join(f"{number} {name}" for number, name in MODELS.items())
            raise HardwareFault(f"says it is model {model}, which is none of {known}")
        if expected not in ("auto", MODELS[model]):
            raise HardwareFault(
                f"says it is {_described(model)}, the file says {expected}; "
                f"set master.device.model: {MODELS[model]}, or plug in the other"
            )
        parameters = self._serial_options.wired(MODELS[model])
        # With `auto` the spec could not promise an orientation.
        self._parameters = parameters.without_gimbal() if expected == "auto" else parameters
        self._model = model

    def _home(self) -> PositionValidator:
        assert self._parameters is not None
        zero: tuple[int, ...] = (0,) * 6
        if self._options.homing == "at_open":
            zero = self._insist(lambda: self._ask(NO_CURRENT)).counts
        elif self._options.homing == "button":  # the device itself sets its counters to zero
            await_press(
                lambda: self._ask(NO_CURRENT),
                lambda before, now: zeroed(before.counts, now.counts),
                self._options.home_patience_s,
            )
        return PositionValidator(self._parameters, zero)


class PolhemSerialDevice(PolhemDevice):
    """Lock-step at the rate of the tick. Without a message for 100 ms the device itself switches its motors off."""

    TIER: ClassVar[Tier] = "emulated only"
    Options = PolhemSerialOptions
    USB: ClassVar[tuple[UsbId, ...]] = (UsbId(0x16C0, 0x0483),)

    def __init__(self, options: PolhemSerialOptions, tick_period: float) -> None:
        named = options.model != "auto"
        parameters = options.wired(options.model)
        super().__init__(
            NAME,
            options,
            parameters if named else parameters.without_gimbal(),
            lambda force_n: BracketExchange(options, force_n),
            tick_period,
            signs=self.fingerprint(options),
            watchdog_s=WATCHDOG_S,
            named=named,
        )

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        """The Teensys; every device with their USB identity where none says that it is one."""
        return teensys(serial_ports(cls.USB), PORTS_BY_ID)

    @classmethod
    def fingerprint(cls, options: PolhemSerialOptions) -> str:
        """Fingerprint of the settings that a sign check holds for."""
        return signs_fingerprint(f"{NAME} {options.model}", options.wired(options.model))


def teensys(found: list[PluggedDevice], by_id: Path) -> list[PluggedDevice]:
    """The ports that name themselves a Teensy, or all if none does: many other boards share their USB identity."""
    links = by_id.glob("*[Tt]eensy*") if by_id.is_dir() else ()
    named = {str(link.resolve()) for link in links}
    theirs = [each for each in found if "teensy" in each.name.lower() or each.path in named]
    return theirs or found


def _described(model: int | None) -> str:
    return f"model {model} ({MODELS.get(model or 0, 'unknown')})"
