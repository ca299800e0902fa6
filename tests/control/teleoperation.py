"""A simulation of both ends of a control scheme in closed loop: a hand, a wall, and a link with delay, jitter and loss.

It has one axis and neither codec nor protocol. At every tick each end sends its newest signal and its credit, and uses
the newest ones that arrived. All randomness comes from one seed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from heapq import heappop, heappush
from math import ceil, pi, sin
from random import Random
from typing import Generic, TypeVar

from weberlink.control.contract import (
    CREDIT_STEP,
    AccountParameters,
    MasterControl,
    SchemeParameters,
    SlaveControl,
    Surface,
)
from weberlink.geometry.vector import Vector

TICK = 1e-3
FORCE_LIMIT = 10.0  # Largest force on the operator's hand [N]
FORCE_RANGE = 30.0  # Range of the robot's sensor [N]
ACCOUNT = AccountParameters(allowance=0.02, refill=0.01, damping=1.0, rise=80.0)  # as in a file without other settings
SETTINGS = SchemeParameters(TICK, 2500.0, ACCOUNT)  # with a coupling of 2500 N/m


@dataclass(frozen=True)
class Wall:
    """Solid below a height [m] on z."""

    stiffness: float = 500.0
    height: float = 0.0

    def at(self, tick: float, position: Vector) -> Vector:
        return (0.0, 0.0, max(0.0, self.stiffness * (self.height - position[2])))


@dataclass(frozen=True)
class Hand:
    """A mass, coupled by a spring and a damper to its intended position; passive except for the intended motion."""

    mass: float = 0.3
    stiffness: float = 300.0
    damping: float = 8.0

    @property
    def parts(self) -> int:
        """Integration steps in a tick; more for a light hand."""
        return max(1, ceil(40.0 * TICK * max((self.stiffness / self.mass) ** 0.5, self.damping / self.mass)))


@dataclass(frozen=True)
class Link:
    """Delay each way [s], jitter on top of it [s], share lost."""

    delay: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0
    seed: int = 1


@dataclass(frozen=True)
class Course:
    """The result of a run per tick: cumulative work at the hand [J], forces [N] and positions [m]."""

    given: list[float]  # work of the hand on the device [J]
    forces: list[float]
    wall_forces: list[float]
    hand: list[float]
    robot: list[float]
    credits: list[int]  # as known at the hand

    def share_of_bound(self, account: AccountParameters) -> float:
        """The largest share of its bound that the energy out of the hand reached."""
        allowed, share, most = account.allowance, 0.0, 0.0
        for tick in range(1, len(self.hand)):
            given, moved = self.given[tick + 1] - self.given[tick], self.hand[tick] - self.hand[tick - 1]
            allowed += account.refill * TICK + account.damping * moved * moved / TICK
            allowed += CREDIT_STEP * (self.credits[tick] - self.credits[tick - 1])
            most = max(most, -given)
            share = max(share, -self.given[tick + 1] / (allowed + most))
        return share


Signal = TypeVar("Signal")


class Direction(Generic[Signal]):
    """One direction of the link, with the newest signal and credit that arrived."""

    def __init__(self, link: Link, random: Random, first: tuple[Signal, int]) -> None:
        self._link, self._random = link, random
        self._flying: list[tuple[int, int, tuple[Signal, int]]] = []
        self._newest = -1
        self.known, self.credit = first

    def carry(self, tick: int, signal: Signal, credit: int) -> None:
        """Send the signal and credit of this tick, and receive what arrives in it."""
        link, flying, chance = self._link, self._flying, self._random.random
        if chance() >= link.loss:
            delay = ceil((link.delay + link.jitter * chance()) / TICK)
            heappush(flying, (tick + delay, tick, (signal, credit)))
        while flying and flying[0][0] <= tick:
            _, told, (known, heard) = heappop(flying)
            if told > self._newest:
                self._newest, self.known, self.credit = told, known, max(self.credit, heard)


def press_and_tap(at: float) -> float:
    """An intended position [m]: two presses of 15 mm with a sway in three seconds, then taps at 4 Hz."""
    if at < 3.0:
        phase = (at % 1.5) / 1.5
        return 0.01 - 0.025 * min(1.0, 4.0 * phase, max(0.0, 4.0 * (0.9 - phase))) + 0.002 * sin(2.0 * pi * 3.0 * at)
    return 0.015 * sin(2.0 * pi * 4.0 * (at - 3.0)) - 0.002


def operate(
    master: MasterControl,
    slave: SlaveControl,
    *,
    wall: Wall,
    link: Link,
    hand: Hand,
    seconds: float,
    intention: Callable[[float], float] = press_and_tap,
    model: Callable[[float, float], Surface] = lambda force, at: None,
) -> Course:
    """Run both ends of a scheme from rest at the intended position of time 0.

    `intention` gives the intended position of the hand [m] at a time [s]; `model` the model that an update carries, by
    its force [N] and the position of the robot [m].
    """
    random = Random(link.seed)
    at, speed = intention(0.0), 0.0
    robot, wall_force, felt = at, 0.0, 0.0
    forward = Direction(link, random, (at, 0))
    backward = Direction(link, random, ((0.0, at), 0))
    rtt = None if link.delay == 0.0 else 2.0 * link.delay
    course = Course([0.0], [], [], [], [], [])
    parts, learned = hand.parts, backward.known
    for tick in range(round(seconds / TICK)):
        moved, heard = at, backward.credit
        at, speed = advance(hand, parts, at, speed, felt, intention(tick * TICK))
        given = -felt * (at - moved)
        if backward.known != learned:
            learned = backward.known
            master.learn(model(*learned), (0.0, 0.0, learned[0]), (0.0, 0.0, learned[1]))
        master.observe((0.0, 0.0, at), TICK, tick, heard, rtt)
        (_, _, sent) = master.command((0.0, 0.0, at))
        (_, _, felt) = master.render((0.0, 0.0, learned[0]))
        felt = min(FORCE_LIMIT, max(-FORCE_LIMIT, felt))
        master.displayed((0.0, 0.0, felt))
        forward.carry(tick, sent, master.credit)
        (_, _, robot) = slave.follow((0.0, 0.0, forward.known), (0.0, 0.0, robot), TICK, forward.credit, rtt)
        wall_force = min(FORCE_RANGE, wall.at(0.0, (0.0, 0.0, robot))[2])
        slave.observe((0.0, 0.0, robot), (0.0, 0.0, wall_force))
        backward.carry(tick, (wall_force, robot), slave.credit)
        course.given.append(course.given[-1] + given)
        course.forces.append(felt)
        course.wall_forces.append(wall_force)
        course.hand.append(at)
        course.robot.append(robot)
        course.credits.append(heard)
    return course


def advance(hand: Hand, parts: int, at: float, speed: float, felt: float, intended: float) -> tuple[float, float]:
    """A tick of the hand under a held force."""
    mass, stiffness, damping, step = hand.mass, hand.stiffness, hand.damping, TICK / parts
    for _ in range(parts):
        force = felt + stiffness * (intended - at) - damping * speed
        speed += force / mass * step
        at += speed * step
    return at, speed
