"""Motion along timed legs, of minimum jerk as a hand goes from one point to the next, or as recorded."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import cos, pi, sin

from weberlink.geometry.vector import Vector, interpolate


def minimum_jerk(share: float) -> float:
    """10 s^3 - 15 s^4 + 6 s^5: the smoothest way from 0 to 1 (Flash and Hogan 1985)."""
    return share * share * share * (10.0 + share * (6.0 * share - 15.0))


@dataclass(frozen=True, slots=True)
class StraightLeg:
    """Straight from `start` to `end`; with the same point twice, a rest."""

    start: Vector
    end: Vector
    duration: float

    def at(self, time: float) -> Vector:
        """Position [m] at a time [s] from its start, 0 to its duration; at rest at both ends."""
        return interpolate(self.start, self.end, minimum_jerk(time / self.duration))


@dataclass(frozen=True, slots=True)
class CircularLeg:
    """`turns` around `center` in a horizontal plane, counterclockwise from the side of +x; else as `StraightLeg`."""

    center: Vector
    radius: float
    turns: float
    duration: float

    @property
    def end(self) -> Vector:
        return self.at(self.duration)

    def at(self, time: float) -> Vector:
        angle = 2.0 * pi * self.turns * minimum_jerk(time / self.duration)
        x, y, z = self.center
        return (x + self.radius * cos(angle), y + self.radius * sin(angle), z)


class RecordedLeg:
    """Linear between positions [m] at times from 0 on [s], strictly rising."""

    def __init__(self, times: Sequence[float], positions: Sequence[Vector]) -> None:
        self._times, self._positions = times, positions
        self.start, self.end, self.duration = positions[0], positions[-1], times[-1]

    def at(self, time: float) -> Vector:
        index = min(bisect_right(self._times, time), len(self._times) - 1)
        begin, end = self._times[index - 1], self._times[index]
        return interpolate(self._positions[index - 1], self._positions[index], (time - begin) / (end - begin))


Leg = StraightLeg | CircularLeg | RecordedLeg


class LegSequence:
    """Legs one after another, once or for ever; a repeated sequence must end where it begins."""

    def __init__(self, legs: Sequence[Leg], repeat: bool) -> None:
        self._legs = [leg for leg in legs if leg.duration > 0.0]
        if not self._legs:
            raise ValueError("a motion needs at least one leg that takes time")
        self._ends = list(accumulate(leg.duration for leg in self._legs))
        self._repeat = repeat
        self.duration = self._ends[-1]  # duration of one round [s]

    def at(self, time: float) -> tuple[Vector, bool]:
        """Position [m] at `time` [s] from the start, and whether the motion is over."""
        if not self._repeat and time >= self.duration:
            return self._legs[-1].at(self._legs[-1].duration), True
        time = time % self.duration if self._repeat else max(time, 0.0)
        leg, ends_at = self._legs[-1], self.duration
        if time < ends_at:  # else by a rounding of what is left
            index = bisect_right(self._ends, time)
            leg, ends_at = self._legs[index], self._ends[index]
        time -= ends_at - leg.duration
        return leg.at(0.0 if time < 0.0 else time if time < leg.duration else leg.duration), False
