"""The driver `touch`: 3D Systems Touch, Touch X and PHANTOM through the maker's library."""

import sys
from collections.abc import Mapping
from math import inf, isfinite
from threading import Thread
from typing import ClassVar

from pydantic import BaseModel

from weberlink.geometry.rotation import IDENTITY, Quaternion
from weberlink.geometry.vector import ZERO, Vector, cube, is_finite, within
from weberlink.hardware.discovery import PluggedDevice, UsbId, serial_ports
from weberlink.hardware.fault import HardwareFault
from weberlink.master.devices.contract import DeviceFault, DeviceReading
from weberlink.master.devices.hardware_device import RAMP_S, STALE_S, fingerprint, force_spec
from weberlink.registry import Tier
from weberlink_devices.rotation_matrix import of_matrix
from weberlink_devices.touch.exchange import ServoState
from weberlink_devices.touch.hdapi import HdError
from weberlink_devices.touch.options import TouchOptions
from weberlink_devices.touch.process import ServoProcess
from weberlink_devices.touch.servo import ServoOrder

NAME = "touch"
BUTTONS = 2
BUTTON_BITS = (1 << BUTTONS) - 1
NOWHERE = DeviceReading(-inf, ZERO, False, IDENTITY)
"""Before the first valid frame; too old for a tick to take."""
UNKNOWN_WATCHDOG = (
    "whether its board removes the force when this host loses its power or the cable is pulled is not published"
)


class TouchDevice:
    """x toward the operator, y to the operator's right, z up; the origin is that of the maker's library.

    The library has a servo thread of its own, in a process of its own: see `weberlink_devices.touch.servo`. Here
    a tick reads and writes shared memory only.
    """

    TIER: ClassVar[Tier] = "judged by others"
    Options: ClassVar[type[BaseModel]] = TouchOptions
    USB: ClassVar[tuple[UsbId, ...]] = (UsbId(0x2988, 0x0302), UsbId(0x0301, 0x2988))
    """The Touch with USB, as two reports have it; the others are not seen."""
    CHOSEN_BY: ClassVar[str] = "name, as the maker's set-up program calls them"
    SIGN_OPTIONS: ClassVar[Mapping[str, str]] = dict.fromkeys(
        "xyz", "there is no option for it: the maker's library gives the directions; calibrate the device"
    )

    def __init__(self, options: TouchOptions, tick_period: float) -> None:
        self.spec = force_spec(
            NAME,
            options,
            self.fingerprint(options),
            force_n=options.force_n,
            axes="xyz",
            stiffness_n_m=options.stiffness_n_m,
            workspace_m=cube(options.reach_m),
            rate_hz=1.0 / tick_period,
            buttons=BUTTONS,
            orientation=True,
            note=UNKNOWN_WATCHDOG,
        )
        self.guarded = self.spec.force_feedback
        """The process of the servo loop takes the force off when this one stops."""
        self._limit = self.spec.force_n
        stale_s = max(STALE_S, 3.0 * tick_period)
        self._process = ServoProcess(
            ServoOrder(options.library, options.name, self.guarded, stale_s, RAMP_S, options.calibration_s)
        )
        self._is_open = False
        self._fault: str | None = None
        self._stopping: Thread | None = None
        self._answer: tuple[float, DeviceReading] | None = None
        self._frames = 0
        self._newest = NOWHERE
        self.trouble: str | None = None
        """Why there is less force than commanded, or why a force may be left; None where there is no such reason."""

    @classmethod
    def plugged(cls) -> list[PluggedDevice] | None:
        """Devices on USB; None without one: those of the network and FireWire are known to the library alone."""
        return serial_ports(cls.USB) or None

    @classmethod
    def fingerprint(cls, options: TouchOptions) -> str:
        """Of what the directions depend on: the library, and which device it is."""
        return fingerprint(f"{NAME} {options.library} {options.name}")

    @property
    def servo_pid(self) -> int | None:
        """Process id of the servo loop; None while there is none."""
        return self._process.pid

    def open(self, now: float) -> None:  # noqa: ARG002
        self.close()
        try:
            described = self._process.start()
            if not (force_n := described["force_n"]) > 0.0:
                raise HardwareFault(f"its largest force is {force_n:g} N, says the library")  # noqa: TRY301
            if (reach_m := described["reach_m"]) > self.spec.workspace_m[1][0]:
                raise HardwareFault(  # noqa: TRY301
                    f"its workspace reaches {reach_m:g} m, says the library; set master.device.reach_m to that"
                )
        except HardwareFault as fault:
            self._stop()
            raise DeviceFault(f"{NAME}: {fault}") from None
        self.trouble = self._fault = None
        self._limit = min(self.spec.force_n, force_n)
        self._frames, self._newest = 0, NOWHERE
        self._is_open = True

    def latest(self, now: float) -> DeviceReading:
        if not self._is_open:
            raise DeviceFault(f"{NAME}: {self._fault or 'not open'}")
        if self._answer is not None and self._answer[0] == now:
            return self._answer[1]
        try:
            state = self._process.state()
        except HardwareFault as fault:
            self._is_open, self._fault = False, str(fault)
            # Taking the force off may take a second, which the tick that ends the session does not have.
            self._stopping = Thread(target=self._stop, name="weberlink-touch-stop")
            self._stopping.start()
            raise DeviceFault(f"{NAME}: {fault}") from None
        reading = self._newest if state.frames == self._frames else self._read(state)
        self._answer = (now, reading)
        return reading

    def _read(self, state: ServoState) -> DeviceReading:
        """The reading of a new frame; the last one again if its values cannot be."""
        self._frames = state.frames
        self.trouble = HdError(state.error, state.internal).in_words if state.error else None
        found = pose(state)
        if found is None:
            self.trouble = "the library gives a transform that cannot be"
        else:
            position, orientation = found
            self._newest = DeviceReading(state.at, position, False, orientation, state.buttons & BUTTON_BITS)
        return self._newest

    def command(self, force: Vector, now: float) -> None:
        if not is_finite(force):
            raise ValueError(f"{NAME}: commanded a force that is not finite: {force}")
        if self._is_open:
            x, y, z = within(force, self._limit)
            self._process.put((y, z, x), now)

    def close(self) -> None:
        if self._stopping is not None:
            self._stopping.join()
            self._stopping = None
        self._is_open = False
        self._fault = None
        self._answer = None
        self._stop()

    def _stop(self) -> None:
        left = self._process.stop()
        if left is not None:
            self.trouble = left
            sys.stderr.write(f"{NAME}: {left}\n")  # the session is over, and nobody reads `trouble` any more


def pose(state: ServoState) -> tuple[Vector, Quaternion] | None:
    """Position [m] and orientation in the frame of the driver; None if a position is not finite or a transform no turn.

    The frames are turned by a third of a turn about the diagonal: x, y, z are z, x, y of the library.
    """
    x, y, z = state.position
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = state.axes
    orientation = of_matrix((zz, xz, yz), (zx, xx, yx), (zy, xy, yy))
    return ((1e-3 * z, 1e-3 * x, 1e-3 * y), orientation) if orientation and isfinite(x + y + z) else None
