"""Virtual walls around where the robot may go; pure."""

from weberlink.geometry.vector import Vector, scale, subtract
from weberlink.master.mapping.frame import Box


class Walls:
    """A box in the robot's frame. The position that is sent stays inside; the hand beyond it is pushed back.

    Args:
        box: lowest and highest corner [m].
        stiffness: of the wall, felt by the hand [N/m].
    """

    __slots__ = ("_high", "_low", "_stiffness")

    def __init__(self, box: Box, stiffness: float) -> None:
        self._low, self._high = box
        self._stiffness = stiffness

    @property
    def box(self) -> Box:
        return self._low, self._high

    def inside(self, position: Vector) -> Vector:
        """The position, or the point of the box that is nearest to it [m]."""
        low, high = self._low, self._high
        return (
            min(max(position[0], low[0]), high[0]),
            min(max(position[1], low[1]), high[1]),
            min(max(position[2], low[2]), high[2]),
        )

    def force(self, way: Vector) -> Vector:
        """On the hand [N], which is this displacement [m, device frame] away from where the wall holds it."""
        return scale(way, -self._stiffness)

    def beyond(self, position: Vector) -> Vector:
        """How far a position is outside [m]."""
        return subtract(position, self.inside(position))
