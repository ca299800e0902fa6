"""Level crossing: a sample is sent when the force crosses a level of a fixed grid.

Bhardwaj, Chaudhuri, Dabeer, "Design and Analysis of Predictive Sampling of Haptic Signals", ACM Trans. Applied
Perception 11(4), 2014: level crossings predict users' clicks on piecewise constant forces slightly better than Weber's
law. Their forces have one axis. Here the grid is one of magnitudes, and the direction has a cone: a grid on each axis
would depend on the choice of axes.
"""

from dataclasses import dataclass, field
from math import degrees, radians
from typing import Annotated, Self

from annotated_types import Interval

from weberlink.codec.deadband import Deadband, DeadbandSetup, check_not_negative
from weberlink.geometry.vector import Vector, distance, norm
from weberlink_predictors.cone import DIRECTION_RAD, ConeOptions, chord, chord_of

LEAST_WEBER = 1e-4  # Smallest Weber factor of the grid; finer than any wire step needs
HYSTERESIS = 0.25
POWERS = 24  # Powers of the level ratio, with exponents 1, 2, 4, ...: enough for any float on the finest grid


@dataclass(frozen=True)
class LevelCrossingOptions(ConeOptions):
    hysteresis: Annotated[float, Interval(ge=0, le=1)] = HYSTERESIS
    """How far beyond a level counts as crossed, as a share of the spacing of levels there."""


@dataclass(frozen=True, slots=True)
class LevelCrossingDeadband(Deadband):
    """Accepts g for f if |f| is past no level between them by more than the hysteresis; f measured, g displayed.

    The levels are multiples of the floor up to about floor / k, and above that a factor of 1 + k apart: the spacing is
    `max(k |f|, floor)`. The hysteresis is `h max(k |f|, floor)`; without it, sensor noise at a level would be sent at
    every tick. The direction is treated as in the cone: the angle is at most theta, or `|g - f| <= floor`. ValueError
    for a number out of its range.
    """

    name = "level_crossing"
    summary = (
        "Sent when the magnitude crosses a level of a fixed grid, or the direction leaves its cone; needs floor_n > 0."
    )
    Options = LevelCrossingOptions
    is_ball = False
    needs_actual = True
    needs_floor = True

    weber: float  # k, >= 0; less than `LEAST_WEBER` counts as `LEAST_WEBER`
    floor: float  # absolute threshold and lowest level [N], > 0
    direction: float = DIRECTION_RAD  # theta [rad], above 0 and at most pi
    hysteresis: float = HYSTERESIS  # h, 0 to 1
    widest: float = field(init=False, repr=False, compare=False)  # Chord of `direction`
    spacing: float = field(init=False, repr=False, compare=False)  # Of levels above the knee, as a share of the lower
    knee: float = field(init=False, repr=False, compare=False)  # The level at which multiples end and powers begin [N]
    powers: tuple[float, ...] = field(init=False, repr=False, compare=False)  # (1 + `spacing`)**(..., 4, 2, 1)

    def __post_init__(self) -> None:
        check_not_negative("weber", self.weber)
        if not 0.0 < self.floor < float("inf"):
            raise ValueError(f"floor must be above 0 and finite, not {self.floor!r}: it is the lowest level")
        if not 0.0 <= self.hysteresis <= 1.0:
            raise ValueError(f"hysteresis must be 0 to 1, not {self.hysteresis!r}")
        spacing = max(self.weber, LEAST_WEBER)
        powers = [1.0 + spacing]
        while len(powers) < POWERS:
            powers.append(powers[-1] * powers[-1])
        object.__setattr__(self, "widest", chord_of(self.direction))
        object.__setattr__(self, "spacing", spacing)
        object.__setattr__(self, "knee", self.floor * max(1, int(1.0 / spacing)))
        object.__setattr__(self, "powers", tuple(reversed(powers)))

    @classmethod
    def configured(cls, setup: DeadbandSetup) -> Self:
        return cls(setup.weber, setup.floor, radians(setup.options.direction_deg), setup.options.hysteresis)

    def describe(self) -> str:
        return f"level crossing, hysteresis {self.hysteresis:g}, direction within {degrees(self.direction):g} deg"

    def bound(self, actual: Vector, displayed: Vector, sent: Vector, moved: float) -> float:  # noqa: ARG002
        return self.hysteresis * max(self.floor, self.spacing * norm(actual))

    def error(self, displayed: Vector, actual: Vector) -> float:
        """How far |f| is past the first level on the way from |g| [N]; the error of the direction if that is more."""
        size, held = norm(actual), norm(displayed)
        past = past_level(size, held, self.floor, self.knee, self.powers)
        ratio = chord(displayed, held, actual, size) / self.widest
        if ratio > 1.0 and distance(displayed, actual) > self.floor:
            return max(past, ratio * max(self.floor, self.spacing * size))
        return past


def past_level(size: float, held: float, floor: float, knee: float, powers: tuple[float, ...]) -> float:
    """How far `size` is past the first level on the way from `held` to it [N]; 0 if there is no level between them."""
    start = level_below(held, floor, knee, powers)
    if level_below(size, floor, knee, powers) == start:
        return 0.0
    if size < held:
        return start - size if start > size else 0.0
    first = level_after(start, floor, knee, powers)
    return size - first if size > first else 0.0


def level_below(size: float, floor: float, knee: float, powers: tuple[float, ...]) -> float:
    """The highest level that is not above `size` [N]; 0 below the lowest. No logarithm, so the same on every host."""
    if not size >= knee:
        return floor * float(int(size / floor)) if size >= floor else 0.0
    level = knee
    for power in powers:
        higher = level * power
        if higher <= size:
            level = higher
    return level


def level_after(level: float, floor: float, knee: float, powers: tuple[float, ...]) -> float:
    """The next higher level [N]."""
    return level + floor if level < knee else level * powers[-1]
