"""Energy that wall and device give away: imposed motions that end where they began, over the real plane and hand.

A wall is active where somebody can get more out of it, through the device, than was put in. On a path that closes,
springs and masses have taken and given back the same; what the held force of the wall delivered beyond what the
device's damping took was made by sampling and holding. Owns the motions and the balance.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import cos, pi
from random import Random

from weberlink.master.devices.hand import Hand
from weberlink.studies.stability.boundary import hand_options, plane
from weberlink.studies.stability.wall import Wall

AMPLITUDE = 1e-3
"""Of the motions [m]."""

LENGTH = 128
"""Ticks of one round of a motion, but for those that return sooner."""


def activity(wall: Wall, stiffness: float) -> float:
    """The most energy that any of the motions got out of wall and device, per energy that the damping took from it.

    Between two samples the device is moved steadily: of all motions through the same samples this is the one that the
    damping takes least from, b dx^2 / T in a tick, and the wall sees only the samples. So nothing gets more out.

    Args:
        wall: the loop; its hand is what holds the device, and does not count.
        stiffness: of the wall [N/m].

    Returns:
        Above 0 the wall is active; -1 where it gave nothing back at all.
    """
    return max(generated(wall, stiffness, motion) for motion in motions())


def generated(wall: Wall, stiffness: float, motion: Sequence[float]) -> float:
    """Energy out of wall and device over one closed round of a motion, in units of what the damping took.

    Rounds before it, which are not counted, bring the delayed forces into step.
    """
    scene = plane(stiffness, wall.wall_damping_n_s_m)
    on_the_way = deque([0.0] * wall.delay_ticks)
    path = [*motion, motion[0]]
    delivered = taken = 0.0
    for counts in [False] * (1 + wall.delay_ticks // len(motion)) + [True]:
        for here, there in pairwise(path):
            on_the_way.append(scene.force((0.0, 0.0, here), wall.tick_period)[2])
            force = on_the_way.popleft()
            if counts:
                delivered += force * (there - here)
                taken += wall.damping_n_s_m * (there - here) ** 2 / wall.tick_period
    return delivered / taken - 1.0


def motions() -> Iterator[list[float]]:
    """Heights over the wall [m], sample by sample: within it and in and out of it, slow to as fast as can be sampled.

    Sinusoids pressed in and at the surface; steps between two places; taps; and a walk at random.
    """
    for turns in (1, 2, 4, 16, 32, 48, 60, 64):
        for middle in (-2.0 * AMPLITUDE, 0.0):
            yield [middle + AMPLITUDE * cos(2.0 * pi * turns * tick / LENGTH) for tick in range(LENGTH)]
    for dwell in (1, 3, 20):
        for middle in (-2.0 * AMPLITUDE, 0.0):
            yield [middle + AMPLITUDE] * dwell + [middle - AMPLITUDE] * dwell
    yield [AMPLITUDE, -AMPLITUDE, AMPLITUDE, AMPLITUDE]
    draw = Random(1).uniform  # noqa: S311 - a fixed motion, not a secret
    yield [draw(-2.0 * AMPLITUDE, AMPLITUDE) for _ in range(LENGTH)]


def bounce(wall: Wall, stiffness: float, speed: float = 0.1, ticks: int = 2000) -> float:
    """Energy of the device when it has left the wall, as a share of that with which it hit it.

    Above 1 the wall has thrown it back harder than it came. Nobody holds it: its hand is as good as none.

    Args:
        wall: the loop; its hand should be next to nothing.
        stiffness: of the wall [N/m].
        speed: into the wall [m/s].
        ticks: to wait for it to leave; 0 is returned if it does not.
    """
    scene = plane(stiffness, wall.wall_damping_n_s_m)
    start = 0.3 * speed * wall.tick_period  # the surface lies between two samples
    hand = Hand(hand_options(wall), (0.0, 0.0, start))
    hand.velocity = (0.0, 0.0, -speed)
    on_the_way = deque([0.0] * wall.delay_ticks)
    for _ in range(ticks):
        on_the_way.append(scene.force(hand.position, wall.tick_period)[2])
        force = on_the_way.popleft()
        if hand.position[2] > 0.0 and hand.velocity[2] > 0.0 and force == 0.0 and not any(on_the_way):
            return (hand.velocity[2] / speed) ** 2
        hand.advance(hand.position, (0.0, 0.0, force), wall.tick_period)
    return 0.0
