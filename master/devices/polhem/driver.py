"""The common part of both Polhem drivers: connecting, homing, limits of force and current, and the spec."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from time import monotonic
from typing import ClassVar, TypeVar

from weberlink.geometry.vector import ZERO, Vector, add, cube
from weberlink.hardware.discovery import DeviceLocator, PluggedDevice
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.master.devices.contract import DeviceReading
from weberlink.master.devices.force_device import force_spec, limited_force
from weberlink.master.devices.polhem.homing import PositionValidator
from weberlink.master.devices.polhem.options import PolhemOptions, reminder
from weberlink.master.devices.polhem.parameters import MechanismParameters
from weberlink.master.devices.threaded_device import ThreadedDevice

BAD_REPLIES = 50
"""Bad replies in a row that are a fault; each takes 10 ms where nothing answers, and the motors get no current from the
first on."""

STALL_S = 0.05
"""Currents computed longer ago than this [s] are not sent: the process has been stopped in between."""

REPLY_S = 0.01
OPENING_S = 0.5
"""Longest time until a device gives good answers after its port was opened [s]: a board just plugged in is slow."""

NO_CURRENT = (0, 0, 0)

Answer = TypeVar("Answer")


class PolhemExchange(ABC):
    """One message out, one answer in; every message feeds the board's own watchdog.

    Args:
        name: of the driver.
        options: of the driver.
        force_n: largest force [N]; 0 for never a current.
        plugged: lists the devices that are plugged in.
    """

    def __init__(
        self, name: str, options: PolhemOptions, force_n: float, plugged: Callable[[], Sequence[PluggedDevice]]
    ) -> None:
        self._options = options
        self._force_n = force_n
        self._locator = DeviceLocator(name, options.port, plugged)
        self._parameters: MechanismParameters | None = None
        self._validator: PositionValidator | None = None
        self._counts: tuple[int, ...] | None = None
        """The last valid ones, relative to the home pose."""

    @property
    def orientation_trouble(self) -> str | None:
        """Why readings lack the orientation although the device has sensors for it; None where they have it."""
        return None

    def start_afresh(self) -> None:
        """Home the device again at the next `open`, whichever device it is."""
        self._locator.forget()
        self._validator = self._counts = None

    def open(self) -> DeviceReading:
        path = self._locator.locate()
        try:
            self._connect(path)
            if self._validator is None:
                self._validator = self._home()
            asked = monotonic()
            counts, _ = self._insist(lambda: self._measure(NO_CURRENT))
            reading = self._validator.begin(counts, asked, monotonic(), oriented=self.orientation_trouble is None)
        except HardwareFault as fault:
            self.close()  # otherwise the next attempt could not open the port
            raise HardwareFault(f"{path}: {str(fault).removeprefix(f'{path}: ')}") from None
        self._counts = self._validator.relative(counts)
        return reading

    def exchange(self, command: Vector) -> DeviceReading:
        assert self._validator is not None
        assert self._parameters is not None
        assert self._counts is not None
        asked, currents = monotonic(), NO_CURRENT
        if command != ZERO:
            mechanism, limit = self._parameters.mechanism, self._options.max_current_ma
            currents = mechanism.limited_currents_ma(command, self._counts, self._force_n, limit)
        counts, buttons = self._measure(currents, asked + STALL_S)
        oriented = self.orientation_trouble is None
        reading = self._validator.next(counts, asked, monotonic(), buttons, oriented=oriented)
        self._counts = self._validator.relative(counts)
        return reading

    def carrying_force(self) -> Vector:
        """Force at the handle that carries the links in the last pose [N]; zero before the first."""
        counts, parameters = self._counts, self._parameters
        return ZERO if counts is None or parameters is None else parameters.mechanism.carrying_force(counts)

    @abstractmethod
    def close(self) -> None: ...

    @abstractmethod
    def _connect(self, path: str) -> None:
        """Open the port, and check that the device is the expected one.

        Raises:
            HardwareFault: it is another one, or the port cannot be opened.
        """

    @abstractmethod
    def _home(self) -> PositionValidator:
        """Find the home pose of a device that was just met."""

    @abstractmethod
    def _measure(self, currents: tuple[int, int, int], fresh_until: float = ...) -> tuple[tuple[int, ...], int]:
        """Send currents [mA], zero after `fresh_until` [s]; get the counts and the buttons pressed, a bit each.

        Raises:
            BadReply: no valid answer.
        """

    def _insist(self, ask: Callable[[], Answer]) -> Answer:
        """Ask until there is a good answer, for `OPENING_S` at most; then raise the last complaint."""
        until = monotonic() + OPENING_S
        while True:
            try:
                return ask()
            except BadReply:
                if monotonic() > until:
                    raise


class PolhemDevice(ThreadedDevice):
    """A device whose first connection after `open` finds its home, and whose later ones keep it.

    Args:
        name: of the driver.
        options: of the driver.
        parameters: of its mechanism.
        exchange: builds the exchange for the largest force [N].
        tick_period: [s].
        signs: fingerprint of the settings; without it as `options.signs_checked` there is no force.
        watchdog_s: of the board [s].
        named: whether the options say which device it is.
        buttons: number of buttons on the handle.

    Raises:
        ValueError: the options ask for more force than the makers publish.
    """

    SIGN_OPTIONS: ClassVar[Mapping[str, str]] = {
        "x": "encoder_directions of B and C, or home_counts",
        "y": "the first of encoder_directions",
        "z": "encoder_directions of B and C, or home_counts",
    }
    """What to change where the position along an axis goes the wrong way."""
    FORCE_OPTIONS: ClassVar[Mapping[str, str]] = {
        "x": "motor_directions of B and C",
        "y": "the first of motor_directions",
        "z": "motor_directions of B and C",
    }
    """What to change where the force along an axis goes the wrong way."""

    def __init__(
        self,
        name: str,
        options: PolhemOptions,
        parameters: MechanismParameters,
        exchange: Callable[[float], PolhemExchange],
        tick_period: float,
        *,
        signs: str,
        watchdog_s: float,
        named: bool = True,
        buttons: int = 0,
    ) -> None:
        spec = force_spec(
            name,
            options,
            signs if named else None,
            force_n=limited_force(options.force_n, parameters.force_n, parameters.name),
            axes="xyz",
            stiffness_n_m=parameters.stiffness_n_m,
            workspace_m=cube(parameters.reach_m),
            rate_hz=1.0 / tick_period,
            buttons=buttons,
            orientation=0 not in parameters.mechanism.drive.gimbal_counts_per_turn,
            watchdog_s=watchdog_s,
            reminder=reminder(options, parameters, named=named),
        )
        self._polhem_exchange = polhem = exchange(spec.force_n)
        self._carries = options.gravity_compensation and spec.force_feedback
        super().__init__(spec, polhem, tick_period, bad_replies=BAD_REPLIES, reconnect=options.reconnect_s)

    @property
    def trouble(self) -> str | None:
        return super().trouble or self._polhem_exchange.orientation_trouble

    def command(self, force: Vector, now: float) -> None:
        """With gravity compensation the command holds the weight of the links too: limits and ramp are for the sum."""
        super().command(add(force, self._polhem_exchange.carrying_force()) if self._carries else force, now)
