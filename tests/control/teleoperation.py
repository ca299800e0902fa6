"""A small world for closed loops of two control sides: a hand, a wall, and a link that delays, loses and shuffles.

On one axis and without codec or protocol: each side tells, at every tick, its newest signal and its sum of credit, and
the other one takes the newest that has arrived. Everything that is random comes from one seed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from heapq import heappop, heappush
from math import ceil, pi, sin
from random import Random

from tests.control.walls import Wall
from weberlink.control.contract import LinkQuality, MasterControl, SlaveControl

TICK = 1e-3
FORCE_LIMIT = 10.0
"""On the operator's hand [N]."""
FORCE_RANGE = 30.0
"""Of the robot's sensor [N]."""
QUIET = LinkQuality(None, 0.0)


@dataclass(frozen=True)
class Hand:
    """A mass that is held by a spring and a damper to where it means to be: passive but for that it moves."""

    mass: float = 0.3
    stiffness: float = 300.0
    damping: float = 8.0

    @property
    def parts(self) -> int:
        """Of a tick, so that a light one is integrated well."""
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
    """What came of a run: cumulative work at the ports [J], and what was felt and done, per tick."""

    given: list[float]
    """By the hand to the device."""
    taken: list[float]
    """By the wall from the robot."""
    forces: list[float]
    wall_forces: list[float]
    hand: list[float]
    robot: list[float]

    @property
    def generated_at_the_hand(self) -> float:
        return -min(0.0, *self.given)

    @property
    def generated_between_the_ports(self) -> float:
        return -min(0.0, *(a - b for a, b in zip(self.given, self.taken, strict=True)))


class Direction:
    """One way of the link; the newest that has arrived is what is known."""

    def __init__(self, link: Link, random: Random, first: tuple[float, int]) -> None:
        self._link, self._random = link, random
        self._flying: list[tuple[int, int, tuple[float, int]]] = []
        self._newest = -1
        self.known, self.credit = first

    def carry(self, tick: int, signal: float, credit: int) -> None:
        """Take what is told at this tick, and deliver what arrives at it."""
        link, flying, chance = self._link, self._flying, self._random.random
        if chance() >= link.loss:
            delay = ceil((link.delay + link.jitter * chance()) / TICK)
            heappush(flying, (tick + delay, tick, (signal, credit)))
        while flying and flying[0][0] <= tick:
            _, told, (known, heard) = heappop(flying)
            if told > self._newest:
                self._newest, self.known, self.credit = told, known, max(self.credit, heard)


def press_and_tap(at: float) -> float:
    """An intention [m]: pressed to 15 mm with a sway, and released, twice in three seconds; then taps at 4 Hz."""
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
    learn: Callable[[MasterControl, float, float, int], None] | None = None,
) -> Course:
    """Run both sides from rest at the intention of time 0.

    Args:
        master, slave: the two sides of a scheme.
        wall: what the robot touches.
        link: between them.
        hand: on the device.
        seconds: how long.
        intention: of the hand [m] over time [s].
        learn: tells the master what an update would, from the force that is known and where it was felt.
    """
    random = Random(link.seed)
    at, speed = intention(0.0), 0.0
    robot, wall_force, felt = at, 0.0, 0.0
    forward = Direction(link, random, (at, 0))
    backward = Direction(link, random, (0.0, 0))
    quality = QUIET if link.delay == 0.0 else LinkQuality(2.0 * link.delay, link.jitter)
    course = Course([0.0], [0.0], [], [], [], [])
    parts = hand.parts
    for tick in range(round(seconds / TICK)):
        moved = at
        at, speed = _advance(hand, parts, at, speed, felt, intention(tick * TICK))
        given = -felt * (at - moved)
        if learn is not None:
            learn(master, backward.known, at, tick)
        master.observe((0.0, 0.0, at), TICK, backward.credit, quality)
        (_, _, felt) = master.render((0.0, 0.0, backward.known))
        felt = min(FORCE_LIMIT, max(-FORCE_LIMIT, felt))
        master.displayed((0.0, 0.0, felt))
        forward.carry(tick, at, master.credit)
        went, before = robot, wall_force
        (_, _, robot) = slave.follow((0.0, 0.0, forward.known), (0.0, 0.0, robot), TICK, forward.credit, quality)
        wall_force = min(FORCE_RANGE, wall.at(0.0, (0.0, 0.0, robot))[2])
        slave.observe((0.0, 0.0, robot), (0.0, 0.0, wall_force))
        backward.carry(tick, wall_force, slave.credit)
        course.given.append(course.given[-1] + given)
        course.taken.append(course.taken[-1] - 0.5 * (before + wall_force) * (robot - went))
        course.forces.append(felt)
        course.wall_forces.append(wall_force)
        course.hand.append(at)
        course.robot.append(robot)
    return course


def _advance(hand: Hand, parts: int, at: float, speed: float, felt: float, intended: float) -> tuple[float, float]:
    """A tick of the hand under a held force."""
    mass, stiffness, damping, step = hand.mass, hand.stiffness, hand.damping, TICK / parts
    for _ in range(parts):
        force = felt + stiffness * (intended - at) - damping * speed
        speed += force / mass * step
        at += speed * step
    return at, speed
