"""What both Polhem drivers are: connecting, homing, limits of force and current, and the spec."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from math import inf
from time import monotonic, sleep
from typing import Any, ClassVar, TypeVar

from weberlink.geometry.vector import ZERO, Vector, add, cube
from weberlink.hardware.discovery import DeviceLocator, PluggedDevice
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.master.devices.contract import DeviceReading
from weberlink.master.devices.force_device import force_spec, limited_force
from weberlink.master.devices.polhem.homing import Counts, PositionValidator
from weberlink.master.devices.polhem.lock_step import FreeRunning, LockStep
from weberlink.master.devices.polhem.options import PolhemOptions
from weberlink.master.devices.polhem.parameters import MechanismParameters
from weberlink.master.devices.polhem.protocol import NO_CURRENT, Message, Sensors
from weberlink.master.devices.threaded_device import ThreadedDevice, fingerprint
from weberlink.registry import Tier

# Bad replies in a row that are a fault; each takes 10 ms where nothing answers, and the motors get no current from the
# first on.
BAD_REPLIES = 50
STALL_S = 0.05  # currents computed longer ago than this [s] are not sent: the process has been stopped in between
REPLY_S = 0.01
# Longest time until a device gives good answers after its port was opened [s]: a board just plugged in is slow.
OPENING_S = 0.5

Answer = TypeVar("Answer")


class PolhemExchange(ABC):
    """One message out, one answer in; every message feeds the board's own watchdog. A subclass knows its wire.

    `force_n` is the largest force [N], 0 for never a current; `plugged` lists the devices that are there, and `connect`
    opens the port at a path.
    """

    NAME: ClassVar[str]  # of the driver
    WATCHDOG_S: ClassVar[float]  # the board switches its motors off after this time without a message [s]

    def __init__(
        self,
        options: Any,
        force_n: float,
        plugged: Callable[[], Sequence[PluggedDevice]],
        connect: Callable[[str], Any],
    ) -> None:
        self._options = options
        self._force_n = force_n
        self._locator = DeviceLocator(self.NAME, options.port, plugged)
        self._open_port = connect
        self._clock, self._pause = monotonic, sleep
        self._parameters: MechanismParameters = options.wired()
        self._dialogue: LockStep | FreeRunning | None = None
        self._validator: PositionValidator | None = None
        self._counts: Counts | None = None  # the last valid ones, relative to the home pose
        self.orientation_trouble: str | None = None
        """Why readings lack the orientation although the device has sensors for it; None where they have it."""

    def start_afresh(self) -> None:
        """Home the device again at the next `open`, whichever device it is."""
        self._locator.forget()
        self._validator = self._counts = None

    def open(self) -> DeviceReading:
        path = self._locator.locate()
        try:
            self._connect(path)
            if self._validator is None:
                self._validator = PositionValidator(self._parameters, self._home())
            asked = self._clock()
            counts = self._continuous(self._insist(NO_CURRENT))
            reading = self._validator.begin(counts, asked, self._clock(), oriented=self.orientation_trouble is None)
        except HardwareFault as fault:
            self.close()  # otherwise the next attempt could not open the port
            raise HardwareFault(f"{path}: {str(fault).removeprefix(f'{path}: ')}") from None
        self._counts = self._validator.relative(counts)
        return reading

    def exchange(self, command: Vector) -> DeviceReading:
        assert self._validator is not None
        assert self._counts is not None
        asked, currents = self._clock(), NO_CURRENT
        if command != ZERO:
            mechanism, limit = self._parameters.mechanism, self._options.max_current_ma
            currents = mechanism.limited_currents_ma(command, self._counts, self._force_n, limit)
        sensors = self._ask(currents, asked + STALL_S)
        counts, oriented = self._continuous(sensors), self.orientation_trouble is None
        reading = self._validator.next(counts, asked, self._clock(), int(sensors.button), oriented=oriented)
        self._counts = self._validator.relative(counts)
        return reading

    def close(self) -> None:
        dialogue = self._dialogue
        if dialogue is not None:
            with suppress(HardwareFault):
                self._ask(NO_CURRENT)
            self._dialogue = None
            dialogue.line.close()

    def carrying_force(self) -> Vector:
        """Force at the handle that carries the links in the last pose [N]; zero before the first."""
        return ZERO if self._counts is None else self._parameters.mechanism.carrying_force(self._counts)

    @abstractmethod
    def _connect(self, path: str) -> None:
        """Open the port and begin the dialogue; raises HardwareFault if that fails, or it is another device."""

    @abstractmethod
    def _await_button(self) -> None:
        """Wait until the calibration button is pressed, and let the counters be those of the home pose."""

    def _home_counts(self) -> Counts:
        """Contents of the counters in the home pose, gimbal in the order of its axes."""
        return (0,) * 6

    def _home_here(self, home: Counts) -> Counts:
        """Make the pose of now the home pose; gives the contents of the counters there."""
        here = self._continuous(self._insist(NO_CURRENT))
        return tuple(count - held for count, held in zip(here, home, strict=True))

    def _home(self) -> Counts:
        """Find the home pose of a device that was just met: the contents of its counters there."""
        home = self._home_counts()
        if self._options.homing == "button":
            self._await_button()
        return self._home_here(home) if self._options.homing == "at_open" else home

    def _continuous(self, sensors: Sensors) -> Counts:
        """Counts without wrapping, those of the gimbal in the order of its axes."""
        return sensors.counts

    def _ask(self, message: Message, fresh_until: float = inf) -> Sensors:
        """One message out and one answer in; raises BadReply where no good one comes. See `LockStep.ask`."""
        assert self._dialogue is not None
        return self._dialogue.ask(message, REPLY_S, fresh_until)

    def _insist(self, message: Message) -> Sensors:
        """Ask until there is a good answer, for `OPENING_S` at most; then raise the last complaint."""
        until = self._clock() + OPENING_S
        while True:
            try:
                return self._ask(message)
            except BadReply:
                if self._clock() > until:
                    raise


class PolhemDevice(ThreadedDevice):
    """A device whose first connection after `open` finds its home, and whose later ones keep it.

    `connect` opens the port at a path; None for that of the driver. Raises ValueError if the options ask for more force
    than the makers publish.
    """

    TIER: ClassVar[Tier] = "emulated only"
    EXCHANGE: ClassVar[type[PolhemExchange]]
    PORT: ClassVar[Any]  # opens the port at a path
    KIND: ClassVar[str]  # option of which the signs depend besides those of the mechanism
    BUTTONS: ClassVar[int] = 0  # on the handle
    SIGN_OPTIONS: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys("xz", "encoder_directions of B and C, or home_counts"),
        "y": "the first of encoder_directions",
    }
    """What to change where the position along an axis goes the wrong way."""
    FORCE_OPTIONS: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys("xz", "motor_directions of B and C"),
        "y": "the first of motor_directions",
    }
    """What to change where the force along an axis goes the wrong way."""

    def __init__(self, options: PolhemOptions, tick_period: float, connect: Callable[[str], Any] | None = None) -> None:
        parameters, driver = options.wired(), self.EXCHANGE
        spec = force_spec(
            driver.NAME,
            options,
            self.fingerprint(options) if options.is_named else None,
            force_n=limited_force(options.force_n, parameters.force_n, parameters.name),
            axes="xyz",
            stiffness_n_m=parameters.stiffness_n_m,
            workspace_m=cube(parameters.reach_m),
            rate_hz=1.0 / tick_period,
            buttons=self.BUTTONS,
            orientation=parameters.mechanism.drive.has_gimbal,
            watchdog_s=driver.WATCHDOG_S,
            reminder=options.reminder(parameters),
        )
        self._polhem = polhem = driver(options, spec.force_n, self.plugged, connect or type(self).PORT)
        self._carries = options.gravity_compensation and spec.force_feedback
        super().__init__(spec, polhem, tick_period, bad_replies=BAD_REPLIES, reconnect=options.reconnect_s)

    @property
    def trouble(self) -> str | None:
        return super().trouble or self._polhem.orientation_trouble

    def command(self, force: Vector, now: float) -> None:
        """With gravity compensation the command holds the weight of the links too: limits and ramp are for the sum."""
        super().command(add(force, self._polhem.carrying_force()) if self._carries else force, now)

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        """The devices that are plugged in."""
        raise NotImplementedError

    @classmethod
    def fingerprint(cls, options: PolhemOptions) -> str:
        """Of all that a sign check holds for: kind, parameter set, signs of encoders and motors, home counts."""
        parameters = options.wired()
        wiring = parameters.mechanism.drive.wiring
        signs = f"encoders {wiring.encoder} motors {wiring.motor} {wiring.home_counts}"
        return fingerprint(f"{cls.EXCHANGE.NAME} {getattr(options, cls.KIND)} {parameters.name} {signs}")
