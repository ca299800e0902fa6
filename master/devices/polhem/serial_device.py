"""`polhem_serial`: Polhem, SensAble PHANTOM with new electronics, or WoodenHaptics, on a Teensy's serial port."""

from collections.abc import Sequence
from math import inf
from pathlib import Path
from typing import Any, ClassVar

from weberlink.hardware.discovery import PluggedDevice, UsbId, serial_ports
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.serial_port import SerialPort
from weberlink.master.devices.polhem.driver import PolhemDevice, PolhemExchange
from weberlink.master.devices.polhem.parameters import PolhemSerialOptions
from weberlink.master.devices.polhem.protocol import (
    GIMBAL_ERRORS,
    MODELS,
    NO_CURRENT,
    SERIAL_WATCHDOG_S,
    Counts,
    Message,
    Sensors,
    SetCounters,
    StatusReader,
    complaint,
    encode_currents,
)

SENSORS = 3  # sensors of the gimbal, of which the firmware reads one per message
REPORTS = "reports"
STRANGER = ": it is no such device, or its firmware is older than 2.0; `weberlink device list` lists what there is"
PORTS_BY_ID = Path("/dev/serial/by-id")
PRESSED_WITHIN_COUNTS = 8  # counters that were set to zero between two looks are within this range
STEP_COUNTS = 40  # a jump to zero from at least this count is the button: no hand is that fast


class BracketExchange(PolhemExchange):
    """Speaks the bracket protocol."""

    NAME = "polhem_serial"
    WATCHDOG_S = SERIAL_WATCHDOG_S

    def __init__(self, options: PolhemSerialOptions, force_n: float, *others: Any) -> None:
        super().__init__(options, force_n, *others)
        self._model: int | None = None
        self._gimbal_doubted = 0

    def send(self, message: Message) -> None:
        assert not isinstance(message, SetCounters)
        self._port.write(encode_currents(message))

    def hear(self, until: float) -> Sequence[Sensors | None]:
        while data := self._port.read(until):
            if answers := self._reader.feed(data):
                return answers
            if self._clock() > until:
                break
        return []

    def _connect(self, path: str) -> None:  # noqa: ARG002
        self._reader = StatusReader()
        try:
            model = self._insist(NO_CURRENT).model
        except BadReply as reply:
            raise HardwareFault(f"{reply}{'' if str(reply).startswith(REPORTS) else STRANGER}") from None
        if self._validator is None:
            self._check_model(model)
        elif model != self._model:
            raise HardwareFault(f"came back as another one: {_described(model)}, not {_described(self._model)}")

    def _check_model(self, model: int) -> None:
        """Take the parameters of the model that answered, if it is the expected one."""
        expected = self._options.model
        if model not in MODELS:
            known = ", ".join(f"{number} {name}" for number, name in MODELS.items())
            raise HardwareFault(f"says it is model {model}, which is none of {known}")
        if expected not in ("auto", MODELS[model]):
            raise HardwareFault(
                f"says it is {_described(model)}, the file says {expected}; "
                f"set master.device.model: {MODELS[model]}, or plug in the other"
            )
        self._mechanism, self._model = self._options.wired(MODELS[model]), model

    def ask(self, message: Message, fresh_until: float = inf) -> Sensors:
        """Raises BadReply for an error of the message as well, since the currents were not applied then."""
        sensors = super().ask(message, fresh_until)
        # A sensor of the gimbal that cannot be read comes after the currents were applied, and leaves the main counts
        # good. The firmware reads one sensor per message, so all are good again after three answers without error.
        gimbal = sensors.error & GIMBAL_ERRORS
        if gimbal:
            self.orientation_trouble = complaint(gimbal)
        if gimbal or (sensors.error and self._gimbal_doubted):
            self._gimbal_doubted = SENSORS
        elif self._gimbal_doubted > 0:
            self._gimbal_doubted -= 1
            if self._gimbal_doubted == 0:
                self.orientation_trouble = None
        if sensors.error & ~GIMBAL_ERRORS:
            raise BadReply(f"{REPORTS} {complaint(sensors.error)}")
        return sensors

    def _await_button(self) -> None:
        self._await_press(zeroed)  # which sets the counters to zero, in the device itself


class PolhemSerialDevice(PolhemDevice):
    """Lock-step at the rate of the tick."""

    Options = PolhemSerialOptions
    EXCHANGE = BracketExchange
    PORT = SerialPort
    KIND = "model"
    USB: ClassVar[tuple[UsbId, ...]] = (UsbId(0x16C0, 0x0483),)

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        """The Teensys; every device with their USB identity where none says that it is one."""
        return teensys(serial_ports(cls.USB), PORTS_BY_ID)


def teensys(found: list[PluggedDevice], by_id: Path) -> list[PluggedDevice]:
    """The ports that name themselves a Teensy, or all if none does: many other boards share their USB identity."""
    links = by_id.glob("*[Tt]eensy*") if by_id.is_dir() else ()
    named = {str(link.resolve()) for link in links}
    theirs = [each for each in found if "teensy" in each.name.lower() or each.path in named]
    return theirs or found


def zeroed(before: Counts, now: Sensors) -> bool:
    """Whether counters were set to zero between two looks."""
    return max(map(abs, now.counts[:3])) <= PRESSED_WITHIN_COUNTS and max(map(abs, before[:3])) >= STEP_COUNTS


def _described(model: int | None) -> str:
    return f"model {model} ({MODELS.get(model or 0, 'unknown')})"
