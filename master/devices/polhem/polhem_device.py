"""What the two drivers share: their spec, and that every `open` homes the device anew. Knows no bytes."""

from collections.abc import Mapping
from typing import ClassVar, Protocol

from codec.vector import Vector
from hardware.worker import Exchange
from master.devices.contract import DeviceReading, DeviceSpec
from master.devices.polhem.options import PolhemOptions
from master.devices.polhem.parameters import Parameters
from master.devices.polhem.permission import force_allowed, notes_of
from master.devices.threaded_device import ThreadedDevice

BAD_REPLIES = 50
"""In a row are a fault, 10 ms each where nothing answers; from the first of them on the motors get no current."""


class PolhemExchange(Exchange[Vector, DeviceReading], Protocol):
    """Takes a force [N]; after `start_afresh`, its next `open` is the first."""

    def start_afresh(self) -> None: ...


class PolhemDevice(ThreadedDevice):
    """A `Device` whose first connection after `open` finds its home, and whose later ones keep it."""

    SIGN_OPTIONS: ClassVar[Mapping[str, str]] = {
        "x": "directions of B and C, or home_counts",
        "y": "the direction of A, the first of directions",
        "z": "directions of B and C, or home_counts",
    }
    """What to change where an axis goes the wrong way."""

    def __init__(self, spec: DeviceSpec, exchange: PolhemExchange, tick_period: float, reconnect: float) -> None:
        super().__init__(spec, exchange, tick_period, bad_replies=BAD_REPLIES, reconnect=reconnect)
        self._exchange = exchange

    def open(self, now: float) -> None:
        self.close()
        self._exchange.start_afresh()
        super().open(now)


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
        watchdog_s: after which the board switches its motors off [s].
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
