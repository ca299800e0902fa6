"""What the two drivers share: their spec, and that every `open` homes the device anew. Knows no bytes."""

from collections.abc import Mapping
from typing import ClassVar, Protocol

from weberlink.geometry.vector import Vector
from weberlink.hardware.worker import Exchange
from weberlink.master.devices.contract import DeviceReading, DeviceSpec
from weberlink.master.devices.polhem.options import PolhemOptions
from weberlink.master.devices.polhem.parameters import Parameters
from weberlink.master.devices.polhem.permission import force_allowed, notes_of
from weberlink.master.devices.threaded_device import ThreadedDevice

BAD_REPLIES = 50
"""In a row are a fault, 10 ms each where nothing answers; from the first of them on the motors get no current."""

STALL_S = 0.05
"""After such a time without an exchange the force comes up from zero again [s]: this process has stood still."""

CARRY_S = 0.03
"""After such a time without a command the weight of the links is carried no more [s]: the loop has failed."""


class PolhemExchange(Exchange[Vector, DeviceReading], Protocol):
    """Takes a force [N]; after `start_afresh`, its next `open` is the first."""

    commanded_at: float
    """When the loop last commanded a force, zero included [s]: while it does, the weight of the links is carried."""

    @property
    def orientation_trouble(self) -> str | None:
        """Why readings have no orientation although the device has sensors for it; None where they have."""
        ...

    def start_afresh(self) -> None: ...


class PolhemDevice(ThreadedDevice):
    """A `Device` whose first connection after `open` finds its home, and whose later ones keep it."""

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

    def __init__(self, spec: DeviceSpec, exchange: PolhemExchange, tick_period: float, reconnect: float) -> None:
        super().__init__(spec, exchange, tick_period, bad_replies=BAD_REPLIES, reconnect=reconnect)
        self._exchange = exchange

    def open(self, now: float) -> None:
        self.close()
        self._exchange.start_afresh()
        super().open(now)

    @property
    def trouble(self) -> str | None:
        return super().trouble or self._exchange.orientation_trouble

    def command(self, force: Vector, now: float) -> None:
        super().command(force, now)
        self._exchange.commanded_at = now


def spec_of(
    name: str,
    options: PolhemOptions,
    parameters: Parameters,
    tick_period: float,
    *,
    signs: str,
    watchdog_s: float,
    named: bool = True,
    buttons: int = 0,
) -> DeviceSpec:
    """The spec of a device.

    Args:
        name: of the driver.
        options: of the driver.
        parameters: of the mechanism.
        tick_period: [s].
        signs: fingerprint of the settings, which `options.signs_checked` has to be for any force.
        watchdog_s: of the board [s].
        named: whether the file says which device it is.
        buttons: on the handle.

    Raises:
        ValueError: the options ask for more force than the makers publish.
    """
    force_n = force_allowed(options, parameters, checked=signs, named=named)
    reach = parameters.reach_m
    return DeviceSpec(
        name=name,
        axes="xyz",
        force_n=force_n,
        stiffness_n_m=parameters.stiffness_n_m,
        workspace_m=((-reach, -reach, -reach), (reach, reach, reach)),
        rate_hz=1.0 / tick_period,
        force_feedback=force_n > 0.0,
        buttons=buttons,
        orientation=0 not in parameters.mechanism.drive.gimbal_counts_per_turn,
        watchdog_s=watchdog_s,
        note="; ".join(notes_of(name, options, parameters, force_n, named=named)),
    )
