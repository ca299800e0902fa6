"""Who deflects an emulated rate-controlled device: a slow swing about the middle, or what somebody has asked for."""

from collections import deque
from collections.abc import Mapping
from math import cos, pi
from typing import ClassVar

from pydantic import BaseModel, ConfigDict, Field

from weberlink.geometry.vector import ZERO, Vector
from weberlink.hardware.emulator import WireFaults

FAULTS: Mapping[str, str] = {
    "x": "push it toward the operator, in percent of a full deflection, and hold it; negative: away",
    "y": "push it to the right, likewise",
    "z": "pull it up, likewise; negative: press it down",
    "release": "let go of it",
    "swing": "deflect it in turn along each axis, as at the beginning",
    "buttons": "hold the buttons whose bits are set in this number",
}
AXES = "xyz"


class ThumbOptions(BaseModel):
    """Options of every emulated rate-controlled device."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    amplitude: Vector = Field(default=(0.6, 0.7, 0.4), description="of the swing, in shares of a full deflection")
    period_s: float = Field(default=3.0, ge=0.1, le=1e3, description="of the swing along y; along x and z, others")
    serial_number: str = Field(default="", description="by which two alike can be told apart")


class ThumbDriven:
    """The common part of the emulators: deflection, buttons and faults.

    Args:
        options: of the emulator.
        most_buttons: number of bits that `buttons` may have.
    """

    OWN_FAULTS: ClassVar[Mapping[str, str]] = FAULTS

    def __init__(self, options: ThumbOptions, most_buttons: int) -> None:
        self.faults = WireFaults()
        self.deflection = ZERO
        """In the frame of the drivers: toward the operator, to the right, up."""
        self.buttons = 0
        self.messages = 0
        """From the host."""
        self.sent = 0
        """Messages to the host."""
        self._options = options
        self._most = (1 << most_buttons) - 1
        self._held: Vector | None = None
        self._began: float | None = None
        self._injected: deque[tuple[str, float]] = deque()

    def inject(self, name: str, value: float = 1.0) -> None:
        """Do one of `OWN_FAULTS` at the next `advance`; from any thread.

        Raises:
            ValueError: there is none of that name, or not with that value.
        """
        if name not in self.OWN_FAULTS:
            raise ValueError(f"no fault is called {name!r}; there are {', '.join(self.OWN_FAULTS)}")
        if name in AXES and not abs(value) <= 100.0:
            raise ValueError(f"{name}: expected a percentage within +-100, got {value:g}")
        if name == "buttons" and value not in range(self._most + 1):
            raise ValueError(f"buttons: expected a whole number from 0 to {self._most}, got {value:g}")
        self._injected.append((name, value))

    def advance(self, now: float) -> None:
        """Move the thumb on to `now` [s]."""
        while self._injected:
            self._suffer(*self._injected.popleft())
        if self._began is None:
            self._began = now
        self.deflection = self._swing(now - self._began) if self._held is None else self._held

    def _suffer(self, name: str, value: float) -> None:
        if name == "buttons":
            self.buttons = int(value)
        elif name == "swing":
            self._held = None
        else:
            held = list(self._held or ZERO)
            if name == "release":
                held = [0.0, 0.0, 0.0]
            else:
                held[AXES.index(name)] = value / 100.0
            self._held = (held[0], held[1], held[2])

    def _swing(self, time: float) -> Vector:
        x, y, z = self._options.amplitude
        angle = 2.0 * pi * time / self._options.period_s
        return (x * cos(0.7 * angle), y * cos(angle), z * cos(1.3 * angle))
