"""Who deflects an emulated rate-controlled device: a slow swing about the middle, or what somebody has asked for."""

from collections.abc import Mapping
from math import cos, pi
from typing import ClassVar

from pydantic import Field

from weberlink.geometry.vector import ZERO, Vector
from weberlink.hardware.emulator import Emulator
from weberlink.options import Options

FAULTS: Mapping[str, str] = {
    "x": "push it toward the operator, in percent of a full deflection, and hold it; negative: away",
    "y": "push it to the right, likewise",
    "z": "pull it up, likewise; negative: press it down",
    "release": "let go of it",
    "swing": "deflect it in turn along each axis, as at the beginning",
    "buttons": "hold the buttons whose bits are set in this number",
}
AXES = "xyz"


class ThumbOptions(Options):
    """Options of every emulated rate-controlled device."""

    amplitude: Vector = Field(default=(0.6, 0.7, 0.4), description="of the swing, in shares of a full deflection")
    period_s: float = Field(default=3.0, ge=0.1, le=1e3, description="of the swing along y; along x and z, others")
    serial_number: str = Field(default="", description="by which two alike can be told apart")


class DeflectionEmulator(Emulator):
    """The common part of the emulators: deflection, a number of buttons, and faults."""

    OWN_FAULTS: ClassVar[Mapping[str, str]] = FAULTS

    def __init__(self, options: ThumbOptions, buttons: int) -> None:
        super().__init__()
        self.fault_values = dict.fromkeys(AXES, 100.0) | {"buttons": range(1 << buttons)}
        self.deflection = ZERO
        """In the frame of the drivers: toward the operator, to the right, up."""
        self.buttons = 0
        self.messages = 0
        """From the host."""
        self.sent = 0
        """Messages to the host."""
        self._options = options
        self._held: Vector | None = None
        self._began: float | None = None

    def advance(self, now: float) -> None:
        """Move the thumb on to `now` [s]."""
        super().advance(now)
        if self._began is None:
            self._began = now
        self.deflection = self._swing(now - self._began) if self._held is None else self._held

    def apply_fault(self, name: str, value: float) -> None:
        match name:
            case "buttons":
                self.buttons = int(value)
            case "swing":
                self._held = None
            case "release":
                self._held = ZERO
            case axis:
                held = dict(zip(AXES, self._held or ZERO, strict=True)) | {axis: value / 100.0}
                self._held = (held["x"], held["y"], held["z"])

    def _swing(self, time: float) -> Vector:
        x, y, z = self._options.amplitude
        angle = 2.0 * pi * time / self._options.period_s
        return (x * cos(0.7 * angle), y * cos(angle), z * cos(1.3 * angle))
