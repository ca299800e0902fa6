"""Random motion of a hand that explores a surface: strokes, loops, taps, presses, and moves through the air."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import cos, hypot, pi, sin
from random import Random

from weberlink.geometry.vector import Vector
from weberlink.master.devices.motion import Leg, StraightLeg, minimum_jerk

Chart = Callable[[Vector], Vector]
"""Maps (u, v, height) to a point [m]: u and v are lengths along a surface; a negative height is the intended depth."""

LIFTED_M = (0.006, 0.02)
"""Range of heights over the surface after release."""
HOME_ABOVE_M = 0.02
BEYOND_S = 1.0
"""The motion is so much longer than the signal, so that no signal ends at rest."""


@dataclass(frozen=True, slots=True)
class ChartLeg:
    """A leg in the coordinates of a chart."""

    chart: Chart
    leg: Leg

    @property
    def duration(self) -> float:
        return self.leg.duration

    def at(self, share: float) -> Vector:
        return self.chart(self.leg.at(share))


@dataclass(frozen=True, slots=True)
class LoopLeg:
    """Whole turns around `center` (u, v), from `start` to `start`."""

    start: Vector
    center: tuple[float, float]
    turns: int
    duration: float

    def at(self, share: float) -> Vector:
        angle = 2.0 * pi * self.turns * minimum_jerk(share)
        u, v, above = self.start
        c, s = cos(angle), sin(angle)
        x, y = u - self.center[0], v - self.center[1]
        return (self.center[0] + c * x - s * y, self.center[1] + s * x + c * y, above)


@dataclass(frozen=True, slots=True)
class ExploredSurface:
    """What is explored.

    Args:
        chart: of the surface.
        reach_m: largest distance from u = v = 0.
        compliance_m_n: intended depth for each newton: compliance of hand and surface together.
        force_n: least and largest intended force.
    """

    chart: Chart
    reach_m: float
    compliance_m_n: float
    force_n: tuple[float, float]


def home(surface: ExploredSurface) -> Vector:
    """Initial position of the hand [m]."""
    return surface.chart((0.0, 0.0, HOME_ABOVE_M))


def exploration(surface: ExploredSurface, duration_s: float, random: Random) -> list[Leg]:
    """Legs from `home` on, for `duration_s` and `BEYOND_S` more; each begins where the last one ends."""
    explorer = Explorer(surface, random)
    legs: list[Leg] = []
    elapsed = 0.0
    while elapsed < duration_s + BEYOND_S:
        for leg in explorer.episode():
            legs.append(ChartLeg(surface.chart, leg))
            elapsed += leg.duration
    return legs


class Explorer:
    """Draws random episodes of legs in (u, v, height)."""

    def __init__(self, surface: ExploredSurface, random: Random) -> None:
        self._surface = surface
        self._random = random
        self._place: Vector = (0.0, 0.0, HOME_ABOVE_M)

    def episode(self) -> Iterator[Leg]:
        (kind,) = self._random.choices((self._strokes, self._loops, self._taps, self._press), (6, 3, 2, 2))
        yield from kind()
        if self._random.random() < 0.45:
            yield from self._away()

    def _strokes(self) -> Iterator[Leg]:
        """To and fro between two places, each pass with another force."""
        ends = self._spot(), self._spot()
        yield self._to((*ends[0], self._depth()), self._uniform(0.5, 0.9))
        for number in range(self._random.randint(1, 4)):
            u, v = ends[1 - number % 2]
            way = hypot(u - self._place[0], v - self._place[1])
            yield self._to((u, v, self._depth()), max(0.3, way / self._uniform(0.03, 0.1)))

    def _loops(self) -> Iterator[Leg]:
        u, v = self._spot()
        yield self._to((u, v, self._depth()), self._uniform(0.5, 0.9))
        turns = self._random.choice((-2, -1, 1, 2))
        radius, angle = self._uniform(0.2, 0.5) * self._surface.reach_m, self._uniform(0.0, 2.0 * pi)
        size = hypot(u, v)
        away = (cos(angle), sin(angle)) if size < radius else (-u / size, -v / size)
        center = (u + radius * away[0], v + radius * away[1])
        yield LoopLeg(self._place, center, turns, abs(turns) * self._uniform(0.9, 2.2))

    def _taps(self) -> Iterator[Leg]:
        u, v = self._spot()
        up = self._uniform(0.003, 0.01)
        yield self._to((u, v, up), self._uniform(0.4, 0.8))
        half = 0.5 / self._uniform(1.0, 2.0)
        for _ in range(self._random.randint(2, 6)):
            yield self._to((u, v, self._depth()), half)
            yield self._to((u, v, up), half)

    def _press(self) -> Iterator[Leg]:
        """Press at one place with changing force and pauses."""
        u, v = self._spot()
        yield self._to((u, v, self._depth()), self._uniform(0.6, 1.0))
        for _ in range(self._random.randint(1, 3)):
            yield self._to((u, v, self._depth()), self._uniform(0.25, 1.0))
            yield self._to(self._place, self._uniform(0.1, 0.4))

    def _away(self) -> Iterator[Leg]:
        """Release, and perhaps move through the air."""
        u, v, _ = self._place
        yield self._to((u, v, self._uniform(*LIFTED_M)), self._uniform(0.3, 0.6))
        if self._random.random() < 0.5:
            yield self._to((*self._spot(), self._uniform(*LIFTED_M)), self._uniform(0.3, 0.7))

    def _to(self, place: Vector, duration: float) -> Leg:
        leg = StraightLeg(self._place, place, duration)
        self._place = place
        return leg

    def _spot(self) -> tuple[float, float]:
        """A random (u, v) within reach."""
        radius = self._surface.reach_m * self._random.random() ** 0.5
        angle = self._uniform(0.0, 2.0 * pi)
        return radius * cos(angle), radius * sin(angle)

    def _depth(self) -> float:
        return -self._surface.compliance_m_n * self._uniform(*self._surface.force_n)

    def _uniform(self, low: float, high: float) -> float:
        return self._random.uniform(low, high)
