"""A bound on each axis of its own: for joints, whose thresholds differ from one to the next."""

from typing import ClassVar, Final

from weberlink.codec.deadband.contract import Deadband, check_not_negative
from weberlink.geometry.vector import Vector


class PerAxisDeadband(Deadband):
    """Weber's law with an absolute threshold on each axis: `|d_i - a_i| <= max(k |a_i|, floor_i)` for all i.

    d is displayed, a measured. The error is the largest of the ratios, so it has no unit, and the bound is 1.

    Args:
        weber: Weber factor k of the value on its own axis, >= 0.
        floors: absolute thresholds in the unit of the values, > 0; infinite for an axis that is not coded.
        resolution: largest error of the wire on an axis, >= 0. A smaller error than this counts as none.

    Raises:
        ValueError: for a number out of its range.
    """

    __slots__ = ("floors", "resolution", "weber")

    name: ClassVar[str] = "per_axis"
    is_ball: ClassVar[bool] = False

    def __init__(self, weber: float, floors: Vector, resolution: float = 0.0) -> None:
        check_not_negative("weber", weber)
        check_not_negative("resolution", resolution)
        for floor in floors:
            if not floor > 0.0:
                raise ValueError(f"the threshold of an axis must be above 0, not {floor!r}")
        self.weber: Final = weber
        self.floors: Final = floors
        self.resolution: Final = resolution

    def bound(self, actual: Vector, displayed: Vector, sent: Vector, moved: float) -> float:  # noqa: ARG002
        return 1.0

    def error(self, displayed: Vector, actual: Vector, /) -> float:
        weber, resolution, floors = self.weber, self.resolution, self.floors
        largest = 0.0
        for index in (0, 1, 2):
            value, floor = actual[index], floors[index]
            apart = abs(displayed[index] - value)
            if apart > resolution:
                largest = max(largest, apart / max(floor, weber * abs(value)))
        return largest
