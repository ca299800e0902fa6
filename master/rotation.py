"""The orientation of the operator's hand as a channel."""

from collections.abc import Callable
from math import inf, pi

from weberlink.geometry.rotation import IDENTITY, Quaternion, inverse, product, unit_quaternion, vector
from weberlink.geometry.vector import ZERO, Vector, add, distance
from weberlink.master.devices.contract import DeviceReading


class HandOrientation:
    """The orientation of the handle as a rotation vector [rad].

    `way` is the sum of all rotations from each reading to the next [rad]: a torque does work over it. `on_jump` is
    called when another vector of nearly the same rotation follows: a new signal, which nothing before it may
    extrapolate.
    """

    def __init__(self, on_jump: Callable[[], None]) -> None:
        self.value: Vector = ZERO
        self.way: Vector = ZERO
        self._before = IDENTITY
        self._usable: Quaternion | None = None
        self._on_jump = on_jump

    def complaint(self, reading: DeviceReading) -> str | None:
        orientation = reading.orientation
        self._usable = None if orientation is None else unit_quaternion(orientation)
        return None if self._usable is not None else f"reports the orientation {orientation}"

    def take(self, reading: DeviceReading) -> None:  # noqa: ARG002 - checked before
        assert self._usable is not None
        self.way = add(self.way, vector(product(self._usable, inverse(self._before))))
        self._before = self._usable
        turned = vector(self._usable, self.value)
        if distance(turned, self.value) > pi:
            self._on_jump()
        self.value = turned

    def sample(self) -> tuple[Vector, Vector, float]:
        return self.value, ZERO, inf
