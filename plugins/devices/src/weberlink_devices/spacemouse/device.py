"""`spacemouse`: the six-axis devices of 3Dconnexion over USB HID, under rate control."""

from collections.abc import Callable
from contextlib import suppress
from math import inf, radians
from time import monotonic
from typing import Any, ClassVar, Literal

from pydantic import Field

from weberlink.geometry.vector import ZERO, Vector
from weberlink.hardware.discovery import DeviceLocator, PluggedDevice, UsbId, hid_devices
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.hid_port import HidPort
from weberlink.registry import Tier
from weberlink_devices.rate_control import WAIT_S, Deflection, RateDevice, RateOptions
from weberlink_devices.spacemouse.reports import FULL_COUNTS, LIGHT, MOST_BUTTONS, Counts, PuckState

NAME = "spacemouse"
GENERIC_DESKTOP, MULTI_AXIS, UNREPORTED = 1, 8, 0
"""Usage page and usage: a wireless receiver has interfaces of other usages too."""
ON, OFF = b"\x01", b"\x00"

Sign = Literal[-1, 1]
Signs = tuple[Sign, Sign, Sign]


class SpaceMouseOptions(RateOptions):
    """Options of `spacemouse`."""

    full_counts: int = Field(default=FULL_COUNTS, ge=10, le=32767, description="count of a full deflection")
    directions: Signs = Field(default=(1, 1, 1), description="-1 reverses the motion along x, y or z")
    spin_deg_s: float | None = Field(
        default=None, gt=0.0, le=720.0, description="turning at full deflection; without it there is no orientation"
    )
    spin_directions: Signs = Field(default=(1, 1, 1), description="-1 reverses the turning about x, y or z")
    release_s: float = Field(
        default=1.0, ge=0.05, le=60.0, description="a deflection that is not reported for this long counts as released"
    )
    light: bool = Field(default=True, description="light it while a session has it open")


class PuckExchange:
    """Reads reports as they come, of the device that is plugged in; it says nothing while it is at rest."""

    def __init__(
        self,
        options: SpaceMouseOptions,
        plugged: Callable[[], list[PluggedDevice]],
        connect: Callable[[str], Any] = HidPort,
        clock: Callable[[], float] = monotonic,
    ) -> None:
        self._options = options
        self._locator = DeviceLocator(NAME, options.port, plugged)
        self._open_port = connect
        self._clock = clock
        self._port: Any = None
        self._state = PuckState()
        self._heard_at = -inf

    def start_afresh(self) -> None:
        """Forget which device it was, at the next `open`."""
        self._locator.forget()

    def open(self) -> Deflection:
        self._port = self._open_port(self._locator.locate())
        self._port.read_all(0.0)  # reports of the time before
        self._state, self._heard_at = PuckState(), -inf
        self._light(ON)
        return Deflection()

    def exchange(self, command: Vector) -> Deflection:  # noqa: ARG002 - it has no way to show a force
        for report in self._port.read_all(self._clock() + WAIT_S):
            self._state = self._state.updated(report)
            self._heard_at = self._clock()
        state, options, full = self._state, self._options, self._options.full_counts
        if self._clock() - self._heard_at > options.release_s:
            return Deflection(buttons=state.buttons)
        turn = ZERO if options.spin_deg_s is None else in_frame(state.rotation, options.spin_directions, full)
        return Deflection(in_frame(state.translation, options.directions, full), turn, state.buttons)

    def close(self) -> None:
        port = self._port
        if port is not None:
            self._light(OFF)
            self._port = None
            port.close()

    def _light(self, state: bytes) -> None:
        """Switch the light; some models have none."""
        if self._port is not None and self._options.light:
            with suppress(HardwareFault):
                self._port.write(state, LIGHT)


def in_frame(counts: Counts, signs: Signs, full: int) -> Vector:
    """Counts (right, toward the operator, down) as shares of a full deflection (toward the operator, right, up)."""
    right, toward, down = counts
    x, y, z = signs
    return (x * toward / full, y * right / full, -z * down / full)


class SpaceMouseDevice(RateDevice):
    """A puck that is pushed and turned; it has no force feedback, and the force is felt as resistance of the rate."""

    TIER: ClassVar[Tier] = "emulated only"
    Options = SpaceMouseOptions
    USB: ClassVar[tuple[UsbId, ...]] = (
        *(UsbId(0x046D, product) for product in (0xC623, 0xC625, 0xC626, 0xC627, 0xC628, 0xC629, 0xC62B)),
        *(UsbId(0x256F, product) for product in (0xC62E, 0xC62F, 0xC631, 0xC632, 0xC633, 0xC635, 0xC636)),
        *(UsbId(0x256F, product) for product in (0xC638, 0xC63A, 0xC641, 0xC652)),
    )
    SIGN_OPTIONS: ClassVar[dict[str, str]] = {axis: f"the sign of {axis} in directions" for axis in "xyz"}

    def __init__(self, options: SpaceMouseOptions, tick_period: float) -> None:
        spin = None if options.spin_deg_s is None else radians(options.spin_deg_s)
        exchange = PuckExchange(options, self.plugged)
        super().__init__(NAME, options, exchange, tick_period, buttons=MOST_BUTTONS, spin=spin)

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        return hid_devices(cls.USB, (GENERIC_DESKTOP, UNREPORTED), (MULTI_AXIS, UNREPORTED))
