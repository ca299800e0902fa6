"""Both ends of a control scheme in closed loop: a hand, a wall, and a link with delay.

It has one axis and neither codec nor protocol. At every tick each end sends its newest signal and its credit.
"""

from collections import deque
from dataclasses import dataclass
from math import ceil, pi, sin

from weberlink.control.contract import MasterControl, SlaveControl

TICK = 1e-3
FORCE_LIMIT = 10.0  # Largest force on the operator's hand [N]
FORCE_RANGE = 30.0  # Range of the robot's sensor [N]
MASS, STIFFNESS, DAMPING = 0.3, 300.0, 8.0  # Of the hand and its hold on where it wants to be [kg, N/m, N s/m]
PARTS = max(1, ceil(40.0 * TICK * max((STIFFNESS / MASS) ** 0.5, DAMPING / MASS)))  # Integration steps in a tick


@dataclass(frozen=True)
class Course:
    """The result of a run per tick: cumulative work of the hand on the device [J], forces [N] and positions [m]."""

    given: list[float]
    wall_forces: list[float]
    robot: list[float]


def press_and_tap(at: float) -> float:
    """An intended position [m]: two presses of 15 mm with a sway in three seconds, then taps at 4 Hz."""
    if at < 3.0:
        phase = (at % 1.5) / 1.5
        return 0.01 - 0.025 * min(1.0, 4.0 * phase, max(0.0, 4.0 * (0.9 - phase))) + 0.002 * sin(2.0 * pi * 3.0 * at)
    return 0.015 * sin(2.0 * pi * 4.0 * (at - 3.0)) - 0.002


def operate(master: MasterControl, slave: SlaveControl, *, wall: float, delay: float, seconds: float) -> Course:
    """Run both ends of a scheme from rest, on a wall of a stiffness [N/m] below 0, with a delay each way [s]."""
    at, speed = press_and_tap(0.0), 0.0
    robot, wall_force, felt = at, 0.0, 0.0
    ticks, rtt = ceil(delay / TICK), 2.0 * delay
    forward = deque([(at, 0)] * ticks)
    backward = deque([(0.0, at, 0)] * ticks)
    course, learned = Course([0.0], [], []), (0.0, at)
    for tick in range(round(seconds / TICK)):
        moved, intended = at, press_and_tap(tick * TICK)
        for _ in range(PARTS):
            speed += (felt + STIFFNESS * (intended - at) - DAMPING * speed) / MASS * TICK / PARTS
            at += speed * TICK / PARTS
        course.given.append(course.given[-1] - felt * (at - moved))
        *newest, heard = backward.popleft()
        if tuple(newest) != learned:
            learned = newest[0], newest[1]
            master.learn(None, (0.0, 0.0, learned[0]), (0.0, 0.0, learned[1]))
        master.observe((0.0, 0.0, at), TICK, tick, heard, rtt)
        (_, _, sent) = master.command((0.0, 0.0, at))
        (_, _, felt) = master.render((0.0, 0.0, learned[0]))
        felt = min(FORCE_LIMIT, max(-FORCE_LIMIT, felt))
        master.displayed((0.0, 0.0, felt))
        forward.append((sent, master.credit))
        target, credit = forward.popleft()
        (_, _, robot) = slave.follow((0.0, 0.0, target), (0.0, 0.0, robot), TICK, credit, rtt)
        wall_force = min(FORCE_RANGE, max(0.0, -wall * robot))
        slave.observe((0.0, 0.0, robot), (0.0, 0.0, wall_force))
        backward.append((wall_force, robot, slave.credit))
        course.wall_forces.append(wall_force)
        course.robot.append(robot)
    return course
