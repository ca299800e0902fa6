"""Level crossing: a sample is sent when the force has crossed a level of a fixed grid, whatever was sent before.

Bhardwaj, Chaudhuri, Dabeer, "Design and Analysis of Predictive Sampling of Haptic Signals", ACM Trans. Applied
Perception 11(4), 2014: level crossings predict users' clicks on piecewise constant forces slightly better than Weber's
law. Their forces have one axis. Here the levels are those of the magnitude, and direction is a cone: levels on each
axis would depend on the choice of axes.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import degrees, radians
from typing import ClassVar, Self

from weberlink.codec.deadband.cone import DIRECTION, DIRECTION_RAD, chord, chord_of
from weberlink.codec.deadband.contract import Deadband, DeadbandSetup, Option, check_not_negative
from weberlink.geometry.vector import Vector, distance, norm

LEAST_WEBER = 1e-4
"""A finer grid counts as this one, which is below any wire's."""
HYSTERESIS = 0.25
POWERS = 24
"""Of the ratio of two levels, squared each time: from one level of the finest grid to the largest number there is."""


@dataclass(frozen=True, slots=True)
class LevelCrossingDeadband(Deadband):
    """No level lies between |g| and |f|, but one that |f| has barely crossed; f measured, g displayed.

    The levels are multiples of the floor up to about floor / k, and from there on one Weber fraction apart: the spacing
    is `max(k |f|, floor)`. Barely means by at most `h max(k |f|, floor)`: without this hysteresis the noise of a sensor
    at a level would be sent at every tick. Direction is as in the cone: within theta, or anywhere where the two are no
    further apart than the floor.

    Args:
        weber: Weber factor k, >= 0; less than 1e-4 counts as that.
        floor: absolute threshold [N], > 0: the lowest level.
        direction: largest angle theta that stays unsent [rad], > 0, at most pi.
        hysteresis: h, 0 to 1.

    Raises:
        ValueError: for a number out of its range.
    """

    name = "level_crossing"
    summary = (
        "Sent when the magnitude crosses a level of a fixed grid, or the direction leaves its cone; needs floor_n > 0."
    )
    options: ClassVar[Mapping[str, Option]] = {
        "direction_deg": DIRECTION,
        "hysteresis": Option(
            HYSTERESIS,
            "How far beyond a level counts as crossed, as a share of the spacing of levels there.",
            0,
            most=1,
        ),
    }
    is_ball = False
    needs_actual = True
    needs_floor = True

    weber: float
    floor: float
    direction: float = DIRECTION_RAD
    hysteresis: float = HYSTERESIS
    widest: float = field(init=False, repr=False, compare=False)
    spacing: float = field(init=False, repr=False, compare=False)
    """Of levels from the knee on, as a share of the lower one."""
    knee: float = field(init=False, repr=False, compare=False)
    """The level at which multiples end and powers begin [N]."""
    powers: tuple[float, ...] = field(init=False, repr=False, compare=False)
    """Of the ratio of two levels, the exponents powers of two, the largest first."""

    def __post_init__(self) -> None:
        check_not_negative("weber", self.weber)
        if not 0.0 < self.floor < float("inf"):
            raise ValueError(f"floor must be above 0 and finite, not {self.floor!r}: it is the lowest level")
        if not 0.0 <= self.hysteresis <= 1.0:
            raise ValueError(f"hysteresis must be 0 to 1, not {self.hysteresis!r}")
        spacing = max(self.weber, LEAST_WEBER)
        object.__setattr__(self, "widest", chord_of(self.direction))
        object.__setattr__(self, "spacing", spacing)
        object.__setattr__(self, "knee", self.floor * max(1, int(1.0 / spacing)))
        object.__setattr__(self, "powers", _powers(1.0 + spacing))

    @classmethod
    def configured(cls, setup: DeadbandSetup) -> Self:
        return cls(setup.weber, setup.floor, radians(setup.options["direction_deg"]), setup.options["hysteresis"])

    def describe(self) -> str:
        return f"level crossing, hysteresis {self.hysteresis:g}, direction within {degrees(self.direction):g} deg"

    def bound(self, actual: Vector, displayed: Vector, sent: Vector, moved: float) -> float:  # noqa: ARG002
        relative = self.spacing * norm(actual)
        return self.hysteresis * (relative if relative > self.floor else self.floor)

    def error(self, displayed: Vector, actual: Vector) -> float:
        """How far the force is past the first level on the way from what is displayed, or how far it has turned."""
        size, held = norm(actual), norm(displayed)
        past = past_level(size, held, self.floor, self.knee, self.powers)
        ratio = chord(displayed, held, actual, size) / self.widest
        if ratio > 1.0 and distance(displayed, actual) > self.floor:
            relative = self.spacing * size
            turned = ratio * (relative if relative > self.floor else self.floor)
            return turned if turned > past else past
        return past


def past_level(size: float, held: float, floor: float, knee: float, powers: tuple[float, ...]) -> float:
    """How far a magnitude is past the first level on the way to it from another; 0 where there is none between."""
    start = level_below(held, floor, knee, powers)
    if level_below(size, floor, knee, powers) == start:
        return 0.0
    if size < held:
        return start - size if start > size else 0.0
    first = level_after(start, floor, knee, powers)
    return size - first if size > first else 0.0


def level_below(size: float, floor: float, knee: float, powers: tuple[float, ...]) -> float:
    """The highest level that is not above a magnitude; 0 below the lowest. Products alone, so the same everywhere."""
    if not size >= knee:
        return floor * float(int(size / floor)) if size >= floor else 0.0
    level = knee
    for power in powers:
        higher = level * power
        if higher <= size:
            level = higher
    return level


def level_after(level: float, floor: float, knee: float, powers: tuple[float, ...]) -> float:
    """The next one."""
    return level + floor if level < knee else level * powers[-1]


def _powers(ratio: float) -> tuple[float, ...]:
    powers = [ratio]
    for _ in range(POWERS - 1):
        powers.append(powers[-1] * powers[-1])
    return tuple(reversed(powers))
