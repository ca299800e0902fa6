"""From the frame of the linkage to that of the device, and back. Pure."""

from typing import NamedTuple

from weberlink.geometry.vector import Vector
from weberlink.master.devices.haply.fivebar import Pair


class Frame(NamedTuple):
    """x toward the operator, y to the operator's right, z up and always 0.

    The linkage's y goes from the motors toward the operator, and its x to the left: the vendor's example programs
    mirror it for the screen.

    Args:
        origin: of the device's frame, in that of the linkage [m].
    """

    origin: Pair

    def position(self, tip: Pair) -> Vector:
        return (tip[1] - self.origin[1], self.origin[0] - tip[0], 0.0)

    def tip(self, position: Vector) -> Pair:
        return (self.origin[0] - position[1], self.origin[1] + position[0])

    @staticmethod
    def force(force: Pair) -> Vector:
        """Of the linkage's, in the device's frame."""
        return (force[1], -force[0], 0.0)

    @staticmethod
    def planar(force: Vector) -> Pair:
        """Of the device's, what lies in the plane, in the linkage's frame."""
        return (-force[1], force[0])
