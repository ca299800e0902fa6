"""The robot's port: passivity observer of the work on the environment, and passivity controller of the robot's steps.

The port is of admittance type: it reads forces and commands positions. The work of a step is computed with the mean of
the forces before and after it, which is exact for a spring. If a stiff contact opens within a step, or the sensor
saturates, the work is bounded so that a wall never seems to return more energy than it took.
"""

from math import hypot, inf, sqrt

from weberlink.control.contract import LEAST_CONTACT
from weberlink.geometry.vector import ZERO, Vector

CAUTION = 4.0
"""Assumed stiffness of a wall over the largest one seen in this contact."""
SATURATED = 0.999
"""Share of the sensor's range from which it counts as saturated."""
LONGEST_RETREAT = 5e-5
"""Longest step back from a wall that is allowed in a tick with an empty tank [m]."""
SHORTEST_WAY = 1e-6
"""Shortest step from which a stiffness is estimated [m]."""


class MotionPort:
    """Observer and controller of the port.

    The energy cost of a step is predicted. In contact, the force is assumed to rise with `CAUTION` times the stiffness
    seen in this contact. In free space a wall may be anywhere, so the force is assumed to jump to the range of the
    sensor. A step is shortened to what the tank can pay. The remaining distance is covered when energy arrives, which
    removes the position drift of the passivity approach.

    Args:
        force_range: largest force that the robot reports [N].
        debt: largest debt that sliding along a surface may make [J].
    """

    __slots__ = ("_debt", "_force", "_force_range", "_position", "_stiffness", "_taken", "_touches")

    def __init__(self, force_range: float, debt: float) -> None:
        self._force_range = force_range
        self._debt = debt
        self.reset()

    def reset(self) -> None:
        self._position: Vector | None = None
        self._force: Vector = ZERO
        self._stiffness = inf
        self._taken = 0.0
        self._touches = False

    @property
    def taken(self) -> float:
        """Work on the environment since the present contact began [J], >= 0; 0 without a contact."""
        return max(0.0, self._taken)

    def book(self, position: Vector, force: Vector) -> float:
        """Take in commanded position [m] and force on the robot [N]; returns the work on the environment [J]."""
        before, earlier, touched = self._position, self._force, self._touches
        self._position, self._force = position, force
        self._touches = hypot(force[0], force[1], force[2]) > LEAST_CONTACT
        if before is None:
            return 0.0
        x, y, z = position[0] - before[0], position[1] - before[1], position[2] - before[2]
        work = -0.5 * ((earlier[0] + force[0]) * x + (earlier[1] + force[1]) * y + (earlier[2] + force[2]) * z)
        if not self._touches:
            work = max(work, -max(0.0, self._taken))
        elif work > 0.0 and self._is_saturated(force):
            work = max(work, -(force[0] * x + force[1] * y + force[2] * z))
        self._taken = self._taken + work if self._touches else 0.0  # since this contact began
        self._learn_stiffness(x * x + y * y + z * z, earlier, touched=touched)
        return work

    def _is_saturated(self, force: Vector) -> bool:
        """Whether a force is at the range of the sensor; it reached that before the end of the step."""
        squared = force[0] * force[0] + force[1] * force[1] + force[2] * force[2]
        return squared >= SATURATED * SATURATED * self._force_range * self._force_range

    def _learn_stiffness(self, squared_way: float, earlier: Vector, *, touched: bool) -> None:
        force = self._force
        if not self._touches:
            self._stiffness = inf
        elif touched and squared_way > SHORTEST_WAY * SHORTEST_WAY:  # part of the first step of a contact was free
            x, y, z = force[0] - earlier[0], force[1] - earlier[1], force[2] - earlier[2]
            seen = ((x * x + y * y + z * z) / squared_way) ** 0.5
            self._stiffness = seen if self._stiffness == inf else max(seen, self._stiffness)

    def affordable(self, target: Vector, here: Vector, tank: float) -> Vector:
        """The farthest point from `here` towards `target` [m] that the tank [J] can pay for."""
        x, y, z = target[0] - here[0], target[1] - here[1], target[2] - here[2]
        squared = x * x + y * y + z * z
        if squared == 0.0:
            return target
        force = self._force
        against = -(force[0] * x + force[1] * y + force[2] * z)
        jump = max(0.0, 0.5 * (self._force_range * squared**0.5 - against))  # by the mean of this force and the range
        share = affordable_share(against, 0.5 * CAUTION * self._stiffness * squared, jump, tank)
        if against < 0.0 and self._touches:  # the step leads out of the wall
            share = max(share, min(1.0, LONGEST_RETREAT / squared**0.5))
        if share == 1.0:
            return target
        pressed = force[0] * force[0] + force[1] * force[1] + force[2] * force[2]
        if against > 0.0 and pressed > 0.0 and tank > -self._debt:  # only the part against the force is shortened
            kept = (1.0 - share) * against / pressed
            return (target[0] + kept * force[0], target[1] + kept * force[1], target[2] + kept * force[2])
        back = 0.0
        if tank < 0.0 < against and pressed > 0.0:  # yielding to the wall pays the debt back
            back = min(-tank / pressed, LONGEST_RETREAT / pressed**0.5)
        return (
            here[0] + share * x + back * force[0],
            here[1] + share * y + back * force[1],
            here[2] + share * z + back * force[2],
        )


def affordable_share(against: float, rise: float, jump: float, tank: float) -> float:
    """The largest share s of a step, 0 to 1, with  s against + min(s^2 rise, s jump) <= tank.

    If the tank is negative and cannot pay for the whole step, it is the share that gains most energy.

    Args:
        against: cost of the whole step at the present force [J]; negative if the environment pushes along the step.
        rise: additional cost of the whole step by a stiffness [J], >= 0; may be infinite.
        jump: additional cost of the whole step by a force that jumps to the range of the sensor [J], >= 0.
        tank: energy in the tank [J]; negative for a debt.
    """
    if against + min(rise, jump) <= tank:
        return 1.0
    if tank < 0.0:
        return _most_gainful_share(against, rise, jump)
    with_jump = tank / (against + jump) if against + jump > 0.0 else 1.0
    return min(1.0, max(with_jump, _share_with_rise(against, rise, tank)))


def _most_gainful_share(against: float, rise: float, jump: float) -> float:
    """The s that minimizes  s against + min(s^2 rise, s jump): the vertex of the parabola, or the whole step."""
    if against >= 0.0:
        return 0.0
    if 2.0 * rise <= -against or against + jump <= -0.25 * against * against / rise:
        return 1.0
    return -0.5 * against / rise


def _share_with_rise(against: float, rise: float, tank: float) -> float:
    """The positive root of  s^2 rise + s against = tank > 0, by the formula without cancellation."""
    if rise == inf:
        return 0.0
    root = sqrt(against * against + 4.0 * rise * tank)
    return 2.0 * tank / (against + root) if against > 0.0 else 0.5 * (root - against) / rise
