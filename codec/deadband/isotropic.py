"""The same bound in all directions: a ball around the measured force, or around a position."""

from typing import ClassVar, Final, Self

from weberlink.codec.deadband.contract import Deadband, DeadbandSetup, Reference, check_not_negative, check_reference
from weberlink.geometry.vector import Vector, distance, norm


class ForceDeadband(Deadband):
    """Weber's law with an absolute threshold: `|f_pred - f| <= max(k |f_ref|, floor)`.

    The floor is the absolute detection threshold: Weber's law fails for small forces, and with `k` alone a sensor at
    rest sends its noise at every tick. A floor of 0 is the paper's decision function.

    Args:
        weber: Weber factor k, >= 0; the paper studies 0.025 to 0.30.
        floor: absolute threshold [N], >= 0.
        reference: the force that k scales: the measured one (the paper), the displayed one or the last one sent.

    Raises:
        ValueError: for a negative or non-finite number or an unknown reference.
    """

    __slots__ = ("floor", "reference", "weber")

    name: ClassVar[str] = "isotropic"
    summary: ClassVar[str] = "The same bound in all directions."

    def __init__(self, weber: float, floor: float = 0.0, reference: Reference = "actual") -> None:
        check_not_negative("weber", weber)
        check_not_negative("floor", floor)
        check_reference(reference)
        self.weber: Final = weber
        self.floor: Final = floor
        self.reference: Final[Reference] = reference

    @classmethod
    def configured(cls, setup: DeadbandSetup) -> Self:
        return cls(setup.weber, setup.floor, setup.reference)

    def bound(self, actual: Vector, displayed: Vector, sent: Vector, moved: float) -> float:  # noqa: ARG002
        name = self.reference
        reference = actual if name == "actual" else displayed if name == "displayed" else sent
        return max(self.floor, self.weber * norm(reference))

    def error(self, displayed: Vector, actual: Vector, /) -> float:
        return distance(displayed, actual)


class PositionDeadband(Deadband):
    """A bound in metres plus a Weber bound on velocity: `least + k |v| T`, T the tick period.

    `k |v| T` is the displacement that a velocity error of `k |v|` makes in one tick. `|v| T` is the distance moved
    since the tick before: no filter, no lag.

    Args:
        weber: Weber factor k of velocity, >= 0.
        least: position bound at rest [m], >= 0.

    Raises:
        ValueError: for a negative or non-finite number.
    """

    __slots__ = ("least", "weber")

    name: ClassVar[str] = "position"
    reads_motion: ClassVar[bool] = True

    def __init__(self, weber: float, least: float) -> None:
        check_not_negative("weber", weber)
        check_not_negative("bound", least)
        self.weber: Final = weber
        self.least: Final = least

    def bound(self, actual: Vector, displayed: Vector, sent: Vector, moved: float) -> float:  # noqa: ARG002
        return self.least + self.weber * moved

    def error(self, displayed: Vector, actual: Vector, /) -> float:
        return distance(displayed, actual)
