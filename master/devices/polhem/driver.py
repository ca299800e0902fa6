"""What both Polhem drivers are: connecting, homing, limits of force and current, and the spec."""

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from time import sleep
from typing import Any, ClassVar

from weberlink.geometry.vector import ZERO, Vector, add, cube
from weberlink.hardware.discovery import DeviceLocator, PluggedDevice
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.master.devices.contract import DeviceReading
from weberlink.master.devices.hardware_device import ThreadedDevice, fingerprint, force_spec, limited_force
from weberlink.master.devices.polhem.homing import PositionValidator
from weberlink.master.devices.polhem.lock_step import LockStep
from weberlink.master.devices.polhem.mechanism import Mechanism
from weberlink.master.devices.polhem.parameters import PolhemOptions
from weberlink.master.devices.polhem.protocol import NO_CURRENT, Counts, Message, Sensors
from weberlink.registry import Tier

# Bad replies in a row that are a fault; each takes 10 ms where nothing answers, and the motors get no current from the
# first on.
BAD_REPLIES = 50
STALL_S = 0.05  # currents computed longer ago than this [s] are not sent: the process has been stopped in between
# Longest time until a device gives good answers after its port was opened [s]: a board just plugged in is slow.
OPENING_S = 0.5
PAUSE_S = 0.002  # between two looks at the calibration button [s]; shorter than every watchdog
LONGEST_S = 0.02  # looks farther apart than this [s] are ignored: the hand may have passed the home pose meanwhile


class PolhemExchange(LockStep):
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
        super().__init__()
        self._options = options
        self._force_n = force_n
        self._locator = DeviceLocator(self.NAME, options.port, plugged)
        self._open_port = connect
        self._pause = sleep
        self._mechanism: Mechanism = options.wired()
        self._port: Any = None
        self._validator: PositionValidator | None = None
        self.orientation_trouble: str | None = None
        """Why readings lack the orientation although the device has sensors for it; None where they have it."""

    def start_afresh(self) -> None:
        """Home the device again at the next `open`, whichever device it is."""
        self._locator.forget()
        self._validator = None

    def open(self) -> DeviceReading:
        path = self._locator.locate()
        try:
            self._port, self._owed = self._open_port(path), 0
            self._connect(path)
            if self._validator is None:
                self._validator = PositionValidator(self._mechanism, self._home())
            asked = self._clock()
            counts = self._continuous(self._insist(NO_CURRENT))
            return self._validator.begin(counts, asked, self._clock(), oriented=self.orientation_trouble is None)
        except HardwareFault as fault:
            self.close()  # otherwise the next attempt could not open the port
            raise HardwareFault(f"{path}: {str(fault).removeprefix(f'{path}: ')}") from None

    def exchange(self, command: Vector) -> DeviceReading:
        assert self._validator is not None
        asked, currents = self._clock(), NO_CURRENT
        if command != ZERO:
            counts, limit = self._validator.counts, self._options.max_current_ma
            currents = self._mechanism.limited_currents_ma(command, counts, self._force_n, limit)
        sensors = self.ask(currents, asked + STALL_S)
        counts, oriented = self._continuous(sensors), self.orientation_trouble is None
        return self._validator.next(counts, asked, self._clock(), int(sensors.button), oriented=oriented)

    def close(self) -> None:
        if self._port is not None:
            with suppress(HardwareFault):
                self.ask(NO_CURRENT)
            self._port.close()
            self._port = None

    def carrying_force(self) -> Vector:
        """Force at the handle that carries the links in the last pose [N]; zero before the first."""
        known = self._validator
        return ZERO if known is None else self._mechanism.carrying_force(known.counts)

    @abstractmethod
    def _connect(self, path: str) -> None:
        """Begin the dialogue on the open port; raises HardwareFault if that fails, or it is another device."""

    @abstractmethod
    def _await_button(self) -> None:
        """Wait until the calibration button is pressed, and let the counters be those of the home pose."""

    def _await_press(self, pressed: Callable[[Counts, Sensors], bool]) -> None:
        """Ask until an answer shows, by the counts of the one before, that the button was pressed between the two;
        raises HardwareFault if nobody presses it within `home_patience_s`, or the device is gone.
        """
        patience = self._options.home_patience_s
        until = self._clock() + patience
        before: tuple[Counts, float] | None = None
        while (began := self._clock()) < until:
            try:
                now = self.ask(NO_CURRENT)
            except BadReply:
                continue
            if before is not None and self._clock() - before[1] <= LONGEST_S and pressed(before[0], now):
                return
            before = (now.counts, began)
            self._pause(PAUSE_S)
        raise HardwareFault(
            f"nobody pressed the calibration button in {patience:g} s; put the handle in its home pose and press it "
            "after the start"
        )

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

    def _insist(self, message: Message) -> Sensors:
        """Ask until there is a good answer, for `OPENING_S` at most; then raise the last complaint."""
        until = self._clock() + OPENING_S
        while True:
            try:
                return self.ask(message)
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
        mechanism, driver = options.wired(), self.EXCHANGE
        spec = force_spec(
            driver.NAME,
            options,
            self.fingerprint(options) if options.is_named else None,
            force_n=limited_force(options.force_n, mechanism.force_n, mechanism.name),
            axes="xyz",
            stiffness_n_m=mechanism.stiffness_n_m,
            workspace_m=cube(mechanism.reach_m),
            rate_hz=1.0 / tick_period,
            buttons=self.BUTTONS,
            orientation=mechanism.has_gimbal,
            watchdog_s=driver.WATCHDOG_S,
            reminder=options.reminder(mechanism),
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
        mechanism = options.wired()
        wiring = mechanism.wiring
        signs = f"encoders {wiring.encoder} motors {wiring.motor} {wiring.home_counts}"
        return fingerprint(f"{cls.EXCHANGE.NAME} {getattr(options, cls.KIND)} {mechanism.name} {signs}")
