"""How an object of a scene moves: to and fro along a line, as a function of time alone. Knows no shape."""

from dataclasses import dataclass
from math import pi, sin
from typing import Literal

from weberlink.geometry.vector import Vector

Wave = Literal["sine", "triangle"]


@dataclass(frozen=True, slots=True)
class Sway:
    """Displacement a w(f t + phase) along `direction` from where the object is written.

    Args:
        direction: unit vector.
        amplitude: a [m], from the middle to either end.
        frequency: f [Hz].
        phase: in turns; at 0 it begins in the middle, on its way along `direction`.
        wave: "sine" for a peak speed of 2 pi f a in the middle, "triangle" for the same speed 4 f a all the way.
    """

    direction: Vector
    amplitude: float
    frequency: float
    phase: float = 0.0
    wave: Wave = "sine"

    @property
    def speed(self) -> float:
        """The largest [m/s]."""
        return (2.0 * pi if self.wave == "sine" else 4.0) * self.frequency * self.amplitude

    def at(self, time: float) -> Vector:
        """Displacement [m] after `time` [s]."""
        turns = self.frequency * time + self.phase
        share = sin(2.0 * pi * turns) if self.wave == "sine" else 4.0 * abs((turns - 0.25) % 1.0 - 0.5) - 1.0
        x, y, z = self.direction
        way = self.amplitude * share
        return (way * x, way * y, way * z)
