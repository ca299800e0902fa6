"""The bound on an unsent position."""

from dataclasses import dataclass
from typing import ClassVar

from weberlink.codec.deadband.contract import check_not_negative
from weberlink.geometry.vector import Vector, distance


@dataclass(frozen=True, slots=True)
class PositionDeadband:
    """A bound in metres plus a Weber bound on velocity: `bound + k |v| T`, T one tick.

    `|v| T` is the way moved since the tick before, so the velocity needs no filter and adds no lag: a hand in fast
    motion is allowed the displacement that a velocity error of k |v| makes in one tick.

    Args:
        weber: Weber factor of velocity, >= 0.
        least: position bound at rest [m], >= 0.

    Raises:
        ValueError: for a negative or non-finite number.
    """

    weber: float
    least: float
    reads_motion: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_not_negative("weber", self.weber)
        check_not_negative("bound", self.least)

    def bound(self, actual: Vector, displayed: Vector, sent: Vector, moved: float) -> float:  # noqa: ARG002
        return self.least + self.weber * moved

    error = staticmethod(distance)
