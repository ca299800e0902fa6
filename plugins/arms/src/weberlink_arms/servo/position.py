"""Followers under the position control of their servos: what they sense, and how they are left.

At rest and in slow motion the motors carry weight, friction and the torque of the environment:

    environment = weight + friction - motor

less a dead zone. The inertia of links and rotors is not subtracted.
"""

from collections.abc import Callable
from contextlib import suppress
from enum import StrEnum
from math import expm1, inf, pi
from typing import Final

from weberlink.geometry.joints import Joints
from weberlink.hardware.fault import HardwareFault

SETTLE_S: Final = 0.1  # in which an arm comes to rest after its goals have moved
SINK_RAD_S: Final = 0.3  # largest speed of the goals of an arm that sinks
# An arm lies once it has not moved, with nothing to carry, for so long: friction carries one that moves slowly.
LIES_S: Final = 0.5
SINK_S: Final = 10.0  # longest time to sink; an arm that does not lie by then is held
STEPS: Final = 4
FALLS: Final = 0.75  # share of its former push below which the push of an axis counts as falling
LEAST_RAD: Final = 0.003  # push of an axis that counts as none, as an error of its angle: two counts of a motor


class OnClose(StrEnum):
    """How an arm is left; `hold` is the default, since without torque it drops."""

    HOLD = "hold"
    SINK = "sink"
    LIMP = "limp"


class LowPass:
    """Of first order, of values that come at irregular times, with a cutoff [Hz] or 0 for none.

    It lags by 1 / (2 pi cutoff) [s] at frequencies well below the cutoff.
    """

    def __init__(self, cutoff: float) -> None:
        self._rate = 2.0 * pi * cutoff
        self._values: tuple[float, ...] = ()
        self._at = 0.0

    @property
    def lag(self) -> float:
        return 1.0 / self._rate if self._rate > 0.0 else 0.0

    def restart(self) -> None:
        """Take the next values as they are."""
        self._values = ()

    def next(self, values: tuple[float, ...], at: float) -> tuple[float, ...]:
        """The filtered values at the time of these [s]."""
        if self._values and self._rate > 0.0:
            share = -expm1(-self._rate * max(0.0, at - self._at))
            values = tuple([old + share * (new - old) for old, new in zip(self._values, values, strict=True)])
        self._values, self._at = values, at
        return values


class PositionControl:
    """Goals and sensed torques of a follower; for exchanges."""

    def __init__(self, stiffness: Joints, dead_zone: Joints, cutoff: float) -> None:
        self._stiffness, self._dead_zone = stiffness, dead_zone
        self._filter = LowPass(cutoff)
        self.goal: Joints = ()  # the last one [rad]
        self.sinks = False  # the arm is to sink by its weight
        self.lies = False  # the motors have nothing to carry any more
        self._still: tuple[float, Joints] = (-inf, ())

    def restart(self, goal: Joints) -> None:
        self.goal = goal
        self.sinks = self.lies = False
        self._still = (-inf, goal)
        self._filter.restart()

    def sink(self, angles: Joints, now: float, period: float) -> None:
        """In each cycle of an arm that sinks: the goals, below which it sags, follow it down at `SINK_RAD_S`."""
        way = SINK_RAD_S * period
        left = [at - goal for at, goal in zip(angles, self.goal, strict=True)]
        self.goal = tuple([goal + min(max(each, -way), way) for goal, each in zip(self.goal, left, strict=True)])
        since, there = self._still
        moved = [at - was for at, was in zip(angles, there, strict=True)]
        if since == -inf or max(map(abs, left + moved)) > LEAST_RAD:
            self._still = (now, angles)
        self.lies = now - self._still[0] > LIES_S

    def sensed(self, torques: Joints, at: float) -> Joints:
        """Filtered torques beyond the dead zone [N m]."""
        felt = zip(self._filter.next(torques, at), self._dead_zone, strict=True)
        return tuple([each - min(max(each, -zone), zone) for each, zone in felt])

    def raised(self, angles: Joints, weight: Joints) -> Joints:
        """Goals at which the motors carry a weight at these angles, and push on nothing [rad].

        Position control needs an error to push: the weight gets its share of it.
        """
        return tuple([angle + each / k for angle, each, k in zip(angles, weight, self._stiffness, strict=True)])

    def leave(
        self,
        place: Callable[[], Joints],
        go: Callable[[Joints], None],
        clock: Callable[[], float],
        pause: Callable[[], None],
    ) -> Joints | None:
        """Move the goals until the arm pushes on nothing; the last ones, or None where they are not known.

        `place` measures goals at which the arm would push on nothing where it is [rad]; `go` sets goals, and is called
        again and again, for watchdogs; `pause` waits for a cycle.
        """

        def settled(goals: Joints) -> Joints:
            until = clock() + SETTLE_S
            while clock() < until:
                go(goals)
                pause()
            return place()

        goals = None
        with suppress(HardwareFault):
            goals = give_way(self.goal, place(), settled)
        return goals


def give_way(goals: Joints, here: Joints, go: Callable[[Joints], Joints]) -> Joints:
    """Move the goals to where the arm is, until it pushes on nothing; returns the last ones [rad].

    A contact follows an axis that gives way, and the push falls; then this axis gives way again. The weight of an arm
    without a model stays, however far it sinks: such an axis gives way once, and sinks by weight over stiffness. `here`
    are goals at which the arm would push on nothing where it is: its angles, raised by what carries its weight if there
    is a model of it. `go` sets goals, waits `SETTLE_S`, and gives the new `here`.
    """
    pushes = [goal - at for goal, at in zip(goals, here, strict=True)]
    gives = [True] * len(goals)
    for _ in range(STEPS):
        goals = tuple([at if each else goal for goal, at, each in zip(goals, here, gives, strict=True)])
        here = go(goals)
        left = [goal - at for goal, at in zip(goals, here, strict=True)]
        axes = zip(gives, left, pushes, strict=True)
        gives = [each and LEAST_RAD < abs(new) < FALLS * abs(old) for each, new, old in axes]
        pushes = left
        if not any(gives):
            break
    return goals
