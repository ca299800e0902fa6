"""The orientation of the operator's hand as a channel."""

from math import inf, pi

from weberlink.codec import Encoder
from weberlink.codec.outgoing import OutgoingChannel
from weberlink.geometry.rotation import IDENTITY, Quaternion, inverse, product, unit_quaternion, vector
from weberlink.geometry.vector import ZERO, Vector, add, distance
from weberlink.master.devices.contract import DeviceReading


class HandOrientation(OutgoingChannel):
    """The orientation of the handle as a rotation vector [rad].

    `way` is the sum of all rotations from each reading to the next [rad]: a torque does work over it.
    """

    def __init__(self, encoder: Encoder) -> None:
        super().__init__(encoder, ZERO)
        self.way: Vector = ZERO
        self._before = IDENTITY
        self._usable: Quaternion | None = None

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
            self.encoder.reset()  # another vector of nearly the same rotation: a new signal
        self.value = turned

    def sample(self, tick: int) -> tuple[Vector, float]:  # noqa: ARG002
        self.sampled = self.value
        return ZERO, inf
