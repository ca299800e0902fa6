"""What the boards have in common: faults that somebody orders, and what can be seen of them from outside."""

from collections import deque
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

from weberlink.geometry.vector import Vector
from weberlink.hardware.emulator import WireFaults
from weberlink.master.devices.polhem.parameters import PARAMETERS
from weberlink.master.emulators.polhem.body import FAULTS, Body, BodyOptions, Counts6, Currents
from weberlink.master.emulators.polhem.built import Built

FARTHEST_MM = 200


class Board:
    """See `weberlink.hardware.emulator`; the bytes are the business of those that inherit.

    Args:
        options: of the device.
        name: of the set of parameters of its mechanism.
        wiring: as a published host expects it.
        watchdog_s: how long the amplifiers stay on after a message [s].
    """

    OWN_FAULTS: ClassVar[Mapping[str, str]] = FAULTS

    def __init__(self, options: BodyOptions, name: str, wiring: Built, watchdog_s: float) -> None:
        self.faults = WireFaults()
        self.messages = 0
        """That came, right or wrong."""
        self.errors = 0
        """Of them, those that were wrong."""
        parameters = PARAMETERS[name]
        self._parameters = parameters
        mechanism, (a, b, c) = parameters.mechanism, options.encoder_signs
        drive = wiring.wire(mechanism.drive)
        d, e, f = drive.encoder_directions
        g, h, i = drive.home_counts
        # The home pose stays where it is: an encoder that counts the other way has its zero on the other side.
        drive = replace(drive, encoder_directions=(a * d, b * e, c * f), home_counts=(a * g, b * h, c * i))
        self._body = Body(options, replace(mechanism, drive=drive), watchdog_s)
        self._processing = options.processing_s
        self._orders: deque[tuple[str, float]] = deque()

    def inject(self, name: str, value: float = 1.0) -> None:
        """Let one of `OWN_FAULTS` happen at the next `advance`; from any thread.

        Raises:
            ValueError: there is none of that name, or not with that value.
        """
        if name not in self.OWN_FAULTS:
            raise ValueError(f"no fault is called {name!r}; there are {', '.join(self.OWN_FAULTS)}")
        highest = {"stuck_encoder": 6, "gimbal_error": 7, "wrong_model": 3}.get(name)
        if highest is not None and value not in range(highest + 1):
            raise ValueError(f"{name}: expected a whole number from 0 to {highest}, got {value:g}")
        if name.endswith("_mm") and not abs(value) <= FARTHEST_MM:
            raise ValueError(f"{name}: expected a distance within +-{FARTHEST_MM} mm, got {value:g}")
        self._orders.append((name, value))

    def _take_orders(self) -> None:
        while self._orders:
            self._suffer(*self._orders.popleft())

    def _suffer(self, name: str, value: float) -> None:
        self._body.suffer(name, value)

    @property
    def currents_ma(self) -> Currents:
        """That flow in the motors now [mA]."""
        return self._body.currents_ma

    @property
    def largest_current_ma(self) -> float:
        """There has ever been in a motor [mA]."""
        return self._body.largest_current_ma

    @property
    def enabled(self) -> bool:
        """Whether the amplifiers are on."""
        return self._body.enabled

    @property
    def force(self) -> Vector:
        """On the hand now [N], in the device's frame."""
        return self._body.force

    @property
    def last_force_at(self) -> float | None:
        """When there was last a current in any motor [s]; None for never."""
        return self._body.last_force_at

    @property
    def position(self) -> Vector:
        """Of the handle [m], in the device's frame."""
        return self._body.handle.position

    @property
    def counts(self) -> Counts6:
        """What the counters hold."""
        return self._body.counts

    @property
    def watchdog_trips(self) -> int:
        return self._body.watchdog_trips
