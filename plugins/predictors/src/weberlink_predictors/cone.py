"""Separate thresholds of magnitude and direction: Weber's law on the magnitude, a cone around the measured force.

The mean JND of the direction of a force is 18.4 degrees with matching vision, 25.6 without vision and 31.9 with
misleading vision (Barbagli, Salisbury, Ho, Spence, Tan, "Haptic discrimination of force direction and the influence of
visual information", ACM Trans. Applied Perception, 2006). An isotropic deadband of k = 0.10 sends at 6 degrees.
docs/deadbands.md states how certain this is.
"""

from dataclasses import dataclass, field
from math import degrees, pi, radians, sin
from typing import Annotated, Self

from annotated_types import Interval

from weberlink.codec.deadband import Deadband, DeadbandSetup, check_not_negative
from weberlink.geometry.vector import Vector, distance, norm

DIRECTION_RAD = radians(18.4)  # The JND with matching vision: an operator sees the scene [rad]


@dataclass(frozen=True)
class ConeOptions:
    direction_deg: Annotated[float, Interval(gt=0.0, le=180.0)] = round(degrees(DIRECTION_RAD), 6)
    """Largest angle between measured and displayed force that stays unsent [degrees]."""


@dataclass(frozen=True, slots=True)
class ConeDeadband(Deadband):
    """`| |g| - |f| | <= max(k |f|, floor)` and angle(f, g) <= theta, or `|g - f| <= floor`; f measured, g displayed.

    A difference below the floor is not felt, whatever its direction; a force of exactly 0 has no direction. The angle
    is compared by its chord, the distance of the two unit vectors, which needs no trigonometry. ValueError for a number
    out of its range.
    """

    name = "cone"
    summary = "Magnitude and direction apart."
    Options = ConeOptions
    is_ball = False
    needs_actual = True

    weber: float  # k, >= 0
    floor: float = 0.0  # absolute threshold [N], >= 0
    direction: float = DIRECTION_RAD  # theta [rad], above 0 and at most pi, which accepts any direction
    widest: float = field(init=False, repr=False, compare=False)  # Chord of `direction`

    def __post_init__(self) -> None:
        check_not_negative("weber", self.weber)
        check_not_negative("floor", self.floor)
        object.__setattr__(self, "widest", chord_of(self.direction))

    @classmethod
    def configured(cls, setup: DeadbandSetup) -> Self:
        return cls(setup.weber, setup.floor, radians(setup.options.direction_deg))

    def describe(self) -> str:
        return f"cone of {degrees(self.direction):g} deg"

    def bound(self, actual: Vector, displayed: Vector, sent: Vector, moved: float) -> float:  # noqa: ARG002
        return max(self.floor, self.weber * norm(actual))

    def error(self, displayed: Vector, actual: Vector) -> float:
        """The larger of the errors of magnitude and direction; that of the direction is `bound` at the angle theta."""
        apart = distance(displayed, actual)
        size, held = norm(actual), norm(displayed)
        bound = max(self.floor, self.weber * size)
        if apart <= self.floor or bound == 0.0:
            return apart
        return max(bound * (chord(displayed, held, actual, size) / self.widest), abs(held - size))


def chord_of(direction: float) -> float:
    """Distance between two unit vectors at an angle [rad], above 0 and at most pi; otherwise ValueError."""
    if not 0.0 < direction <= pi:
        raise ValueError(f"direction must be above 0 and at most pi [rad], not {direction!r}")
    return 2.0 * sin(0.5 * direction)


def chord(a: Vector, length: float, b: Vector, other: float) -> float:
    """Distance between the unit vectors of two vectors of these lengths; 0 if one of them is zero."""
    if length == 0.0 or other == 0.0:
        return 0.0
    one = (a[0] / length, a[1] / length, a[2] / length)
    return distance(one, (b[0] / other, b[1] / other, b[2] / other))
