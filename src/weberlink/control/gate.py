"""How everything that leaves for a hand or a robot comes to what is wanted: in steps, and slowly until it is there.

Each end has one gate, which adds its own bounds: `weberlink.master.gate.OutputGate`, `weberlink.slave.guard.Guard`.
"""

from collections.abc import Callable, Sequence
from math import dist, hypot
from typing import Any

from weberlink.compiled import mypyc_attr
from weberlink.geometry.joints import Joints


def toward(start: Joints, goal: Joints, way: float) -> Joints:
    """The goal, or the point on the way to it that is `way` from the start."""
    length = dist(start, goal)
    if not length > way:  # a way without end is NaN where no time has passed
        return goal
    share = way / length
    return tuple([a + share * (b - a) for a, b in zip(start, goal, strict=True)])


@mypyc_attr(allow_interpreted_subclasses=True)
class Approach:
    """Follows a value in bounded steps, part by part; until it has arrived, in smaller ones.

    A part is some axes that have one length: the three of a force or a position, or a single axis of an arm.

    Args:
        start: what left last.
        width: how many axes each part has.
        rates: fastest change of each part while it follows [1/s], > 0; may be infinite.
        approaches: the same until it has arrived.
        grows: whether the approach bounds how fast a value grows, not how it changes: a force may fall at once.
        step_toward: the point on the way to the second value that is so far from the first.

    Attributes:
        parts: of each the first axis, the one after the last, its rate, and that of its approach.
        held: what left last.
        arrived: whether the approach is over.
        held_back: whether the rate held back a value that is not in the approach.
    """

    __slots__ = ("_grows", "_rate", "_rest", "_step_toward", "arrived", "held", "held_back", "parts")

    def __init__(
        self,
        start: Joints,
        width: int,
        rates: Sequence[float],
        approaches: Sequence[float],
        *,
        grows: bool = False,
        step_toward: Callable[[Any, Any, float], Any] = toward,
    ) -> None:
        if len(start) != width * len(rates):
            raise ValueError(f"{len(start)} axes, but {len(rates)} parts of {width}")
        self.parts: list[tuple[int, int, float, float]] = []
        for first, rate, approach in zip(range(0, len(start), width), rates, approaches, strict=True):
            if not (rate > 0.0 and approach > 0.0):
                raise ValueError(f"rates must be positive, not {rate!r} and {approach!r}")
            self.parts.append((first, first + width, rate, approach))
        self._rate = rates[0] if len(rates) == 1 else None
        self._grows, self._rest, self._step_toward = grows, (0.0,) * len(start), step_toward
        self.held = start
        self.arrived = self.held_back = False

    def advance(self, goal: Joints, step: float, faded: Joints | None = None) -> Joints:
        """Go on towards a goal, as far as the time `step` [s] allows.

        Args:
            goal: what is wanted.
            step: [s].
            faded: what a fade leaves of what left last; its way counts, so that both take no more than the rate allows,
                or than the fade alone.
        """
        last, arrived = self.held, self.arrived
        held = last if faded is None else faded
        self.held_back = False
        if goal == held:
            self.held, self.arrived = held, True
            return held
        if arrived and faded is None and self._rate is not None:  # the one part of a hand follows: most ticks
            moved: Joints = self._step_toward(held, goal, self._rate * step)
            self.held_back = moved != goal
            self.held = moved
            return moved
        moved = ()
        for first, last_axis, rate, approach in self.parts:
            here, there = held[first:last_axis], goal[first:last_axis]
            way = rate * step
            if faded is not None:
                way = max(0.0, way - dist(last[first:last_axis], here))
            if not arrived:
                if self._grows:
                    there = toward(self._rest[first:last_axis], there, hypot(*here) + approach * step)
                else:
                    way = approach * step
            part = self._step_toward(here, there, way)
            self.held_back = self.held_back or part != there
            moved += part
        self.held = moved
        self.arrived = arrived or moved == goal
        return moved
