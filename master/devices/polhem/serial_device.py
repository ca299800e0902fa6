"""`polhem_serial`: Polhem, SensAble PHANTOM with new electronics, or WoodenHaptics, on a Teensy's serial port."""

from contextlib import suppress
from math import inf
from pathlib import Path
from time import monotonic
from typing import ClassVar

from weberlink.geometry.vector import ZERO, Vector
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.found import Found, UsbId, serial_ports
from weberlink.master.devices.contract import DeviceReading
from weberlink.master.devices.polhem.bracket import GIMBAL_ERRORS, MODELS, WATCHDOG_S, Currents, Status, complaint
from weberlink.master.devices.polhem.force_stage import ForceStage
from weberlink.master.devices.polhem.homing import await_press, zeroed
from weberlink.master.devices.polhem.identity import Identity, located
from weberlink.master.devices.polhem.lock_step import LockStep
from weberlink.master.devices.polhem.options import PolhemSerialOptions
from weberlink.master.devices.polhem.polhem_device import CARRY_S, STALL_S, PolhemDevice, spec_of
from weberlink.master.devices.polhem.serial_line import SerialLine
from weberlink.master.devices.polhem.sign_check import fingerprint
from weberlink.master.devices.polhem.whereabouts import Whereabouts

NAME = "polhem_serial"
NO_CURRENT: Currents = (0, 0, 0)
REPLY_S = 0.01
OPENING_S = 0.5
"""How long a port may take until its answers are good [s]: a board that was just plugged in takes a while."""

SENSORS = 3
"""Of the gimbal, of which the firmware reads one per message."""

REPORTS = "reports"
STRANGER = ": it is no such device, or its firmware is older than 2.0; `weberlink devices` lists what there is"

PORTS_BY_ID = Path("/dev/serial/by-id")


class BracketExchange:
    """One message out, one answer in. The device's own watchdog (100 ms) is fed by every exchange.

    Args:
        options: of the driver.
        force_n: largest force [N]; 0 for never a current.
    """

    def __init__(self, options: PolhemSerialOptions, force_n: float) -> None:
        self._options = options
        self._force_n = force_n
        self._identity = Identity(NAME, options.port, PolhemSerialDevice.plugged)
        self._line: SerialLine | None = None
        self._talk: LockStep[Currents, Status] | None = None
        self._model: int | None = None
        self._whereabouts: Whereabouts | None = None
        self._stage: ForceStage | None = None
        self._gimbal_doubted = 0
        self._gimbal_complaint = ""
        self._counts: tuple[int, ...] = ()
        self._asked_at = 0.0
        self._force_from = 0.0
        self.commanded_at = 0.0

    def start_afresh(self) -> None:
        self._identity.forget()
        self._whereabouts = None

    def open(self) -> DeviceReading:
        path = self._identity.locate()
        self._line = SerialLine(path)
        self._talk = LockStep(self._line, NO_CURRENT)
        try:
            model = self._insist().model
            if self._whereabouts is None:
                self._whereabouts = self._meet(model)
                self._home(self._whereabouts)
            else:
                self._recognise(model)
            self._asked_at = self._force_from = asked = monotonic()
            self._counts = self._insist().counts
            return self._whereabouts.begin(self._counts, asked, monotonic(), oriented=self._oriented)
        except HardwareFault as fault:
            self.close()  # the next attempt could not open it otherwise
            raise located(path, fault) from None

    def exchange(self, command: Vector) -> DeviceReading:
        assert self._whereabouts is not None
        assert self._stage is not None
        asked, currents = monotonic(), NO_CURRENT
        if asked - self._asked_at > STALL_S:
            self._force_from = asked
        self._asked_at = asked
        carry = self._options.gravity_compensation and asked - self.commanded_at < CARRY_S
        if carry or command != ZERO:
            relative = self._whereabouts.relative(self._counts)
            currents = self._stage.currents_ma(command, relative, asked - self._force_from)
        counts = self._ask(currents, asked + STALL_S).counts
        reading = self._whereabouts.next(counts, asked, monotonic(), oriented=self._oriented)
        self._counts = counts
        return reading

    def close(self) -> None:
        line, self._line = self._line, None
        if line is not None:
            with suppress(HardwareFault):
                self._ask(NO_CURRENT)
            line.close()

    def _ask(self, currents: Currents, fresh_until: float = inf) -> Status:
        """One round trip; raises BadReply for an error of the message, since the currents were not applied then.

        A sensor of the gimbal that cannot be read comes after the currents were applied, and leaves the main counts
        good. The firmware reads one sensor per message, so all three are good again after three answers without error.
        """
        assert self._talk is not None
        status = self._talk.ask(currents, REPLY_S, fresh_until)
        if status.error & GIMBAL_ERRORS:
            self._gimbal_complaint = complaint(status.error & GIMBAL_ERRORS)
        if status.error & GIMBAL_ERRORS or (status.error and self._gimbal_doubted):
            self._gimbal_doubted = SENSORS
        elif status.error == 0:
            self._gimbal_doubted = max(0, self._gimbal_doubted - 1)
        if status.error & ~GIMBAL_ERRORS:
            raise BadReply(f"{REPORTS} {complaint(status.error)}")
        return status

    @property
    def _oriented(self) -> bool:
        return self._gimbal_doubted == 0

    @property
    def orientation_trouble(self) -> str | None:
        return None if self._oriented else self._gimbal_complaint

    def _insist(self) -> Status:
        """A good answer, from a board that may still have to begin."""
        until = monotonic() + OPENING_S
        while True:
            try:
                return self._ask(NO_CURRENT)
            except BadReply as reply:
                if monotonic() > until:
                    advice = "" if str(reply).startswith(REPORTS) else STRANGER
                    raise HardwareFault(f"{reply}{advice}") from None

    def _meet(self, model: int) -> Whereabouts:
        """Take up the mechanism of the model that answered, if it is the right one."""
        options = self._options
        expected = options.model
        if model not in MODELS:
            known = ", ".join(f"{number} {name}" for number, name in MODELS.items())
            raise HardwareFault(f"says it is model {model}, which is none of {known}")
        if expected not in ("auto", MODELS[model]):
            raise HardwareFault(
                f"says it is {_called(model)}, the file says {expected}; "
                f"set master.device.model: {MODELS[model]}, or plug in the other"
            )
        parameters = options.wired(MODELS[model])
        if expected == "auto":  # which cannot promise an orientation
            parameters = parameters.without_gimbal()
        self._model = model
        self._stage = ForceStage(
            parameters.mechanism, self._force_n, options.max_current_ma, carry=options.gravity_compensation
        )
        return Whereabouts(parameters, (0,) * 6)

    def _recognise(self, model: int) -> None:
        if model != self._model:
            raise HardwareFault(f"came back as another one: {_called(model)}, not {_called(self._model)}")

    def _home(self, whereabouts: Whereabouts) -> None:
        if self._options.homing == "at_open":
            whereabouts.home(self._insist().counts)
        elif self._options.homing == "button":  # the device itself sets its counters to zero
            await_press(
                lambda: self._ask(NO_CURRENT),
                lambda before, now: zeroed(before.counts, now.counts),
                self._options.home_patience_s,
            )


class PolhemSerialDevice(PolhemDevice):
    """Lock-step at the rate of the tick. Without a message for 100 ms the device itself switches its motors off."""

    Options = PolhemSerialOptions
    USB: ClassVar[tuple[UsbId, ...]] = (UsbId(0x16C0, 0x0483),)

    def __init__(self, options: PolhemSerialOptions, tick_period: float) -> None:
        """Raises ValueError where the options ask for more than the makers publish."""
        named = options.model != "auto"
        parameters = options.wired(options.model)
        spec = spec_of(
            NAME,
            options,
            parameters if named else parameters.without_gimbal(),
            tick_period,
            signs=self.fingerprint(options),
            watchdog_s=WATCHDOG_S,
            named=named,
        )
        super().__init__(spec, BracketExchange(options, spec.force_n), tick_period, options.reconnect_s)

    @classmethod
    def plugged(cls) -> list[Found]:
        """The Teensys; every device with their USB identity where none says that it is one."""
        return teensys(serial_ports(cls.USB), PORTS_BY_ID)

    @classmethod
    def fingerprint(cls, options: PolhemSerialOptions) -> str:
        """Of the settings that a sign check is good for."""
        return fingerprint(f"{NAME} {options.model}", options.wired(options.model))


def teensys(found: list[Found], by_id: Path) -> list[Found]:
    """Those of the ports that call themselves a Teensy, or all if none does: their USB identity is shared by many."""
    links = by_id.glob("*[Tt]eensy*") if by_id.is_dir() else ()
    named = {str(link.resolve()) for link in links}
    theirs = [each for each in found if "teensy" in each.name.lower() or each.path in named]
    return theirs or found


def _called(model: int | None) -> str:
    return f"model {model} ({MODELS.get(model or 0, 'unknown')})"
