"""The robot's port: passivity observer of the work on the environment, and passivity controller of the robot's steps.

The port is of admittance type: it reads forces and commands positions. The work of a step is computed with the mean of
the forces before and after it, which is exact for a spring. If a stiff contact opens within a step, or the sensor
saturates, the work is bounded so that a wall never seems to return more energy than it took.
"""

from math import hypot, inf

from weberlink.control.contract import LEAST_CONTACT
from weberlink.control.energy import root_share
from weberlink.geometry.sliding import Sliding
from weberlink.geometry.vector import ZERO, Vector, add, scale, unit

CAUTION = 4.0
"""Assumed stiffness of a wall over the largest one seen in this contact."""
SATURATED = 0.999
"""Share of the sensor's range from which it counts as saturated."""
LONGEST_RETREAT = 5e-5
"""Longest step back from a wall that is allowed in a tick with an empty tank [m]."""
SHORTEST_WAY = 1e-6
"""Shortest step from which a stiffness is estimated [m]."""
DEEPEST_REST = 1e-3
"""Longest way from the end of a contact to outside the surface [m]."""
LEAST_RISE = 0.5
"""Smallest force of a first contact that shows the stiffness of the robot [N]."""


class MotionPort:
    """Observer and controller of the port.

    The energy cost of a step is predicted. The force is assumed to rise with `CAUTION` times the stiffness seen in this
    contact, or in free space, where a wall may be anywhere, with that of the robot towards its command; at most to the
    range of the sensor. A step is shortened to what the tank can pay. The remaining distance is covered when energy
    arrives, which removes the position drift of the passivity approach.

    On a surface with friction, only the part normal to the surface is shortened: the robot follows along the surface,
    and lifts by as much as pays for that. This is always possible if the friction coefficient is below 1. The normal is
    told from the direction of sliding. A robot in debt that has lifted off stays outside the surface until the debt is
    paid.

    Args:
        force_range: largest force that the robot reports [N].
        stiffness: of the robot towards its command [N/m].
        debt: largest debt that a first contact may make [J].
    """

    __slots__ = (
        "_coupling",
        "_debt",
        "_force",
        "_force_range",
        "_outside",
        "_position",
        "_seen",
        "_sliding",
        "_stated",
        "_stiffness",
        "_taken",
        "_touches",
    )

    def __init__(self, force_range: float, stiffness: float, debt: float) -> None:
        self._force_range = force_range
        self._stated = self._coupling = stiffness
        self._debt = debt
        self._sliding = Sliding()
        self.reset()

    def renew(self) -> None:
        """Begin a new session: what was learned of the robot's stiffness is forgotten too."""
        self._coupling = self._stated
        self.reset()

    def reset(self) -> None:
        """Continue after an interruption; a stiffness beyond the stated one stays known."""
        self._position: Vector | None = None
        self._force: Vector = ZERO
        self._stiffness = self._coupling
        self._seen = False
        self._taken = 0.0
        self._touches = False
        self._outside: tuple[Vector, Vector] | None = None
        self._sliding.reset()

    @property
    def touches(self) -> bool:
        """Whether the robot touches something."""
        return self._touches

    @property
    def taken(self) -> float:
        """Work on the environment since the present contact began [J], >= 0; 0 without a contact."""
        return max(0.0, self._taken)

    def book(self, position: Vector, force: Vector) -> float:
        """Take in commanded position [m] and force on the robot [N]; returns the work on the environment [J]."""
        before, earlier, touched = self._position, self._force, self._touches
        out = self._sliding.normal_part(earlier)
        self._position, self._force = position, force
        self._touches = hypot(force[0], force[1], force[2]) > LEAST_CONTACT
        if self._touches:
            self._outside = None
        elif touched:
            # What is left of the depth: less force than this does not count as contact, but rubs.
            left = min(2.0 * LEAST_CONTACT / (self._stiffness or inf), DEEPEST_REST)
            normal = unit(out)
            self._outside = add(position, scale(normal, left)), normal
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
        if touched and self._touches:
            change = (force[0] - earlier[0], force[1] - earlier[1], force[2] - earlier[2])
            self._sliding.move((x, y, z), change, self._stiffness or inf)
        return work

    def _is_saturated(self, force: Vector) -> bool:
        """Whether a force is at the range of the sensor; it reached that before the end of the step."""
        squared = force[0] * force[0] + force[1] * force[1] + force[2] * force[2]
        return squared >= SATURATED * SATURATED * self._force_range * self._force_range

    def _learn_stiffness(self, squared_way: float, earlier: Vector, *, touched: bool) -> None:
        if squared_way > SHORTEST_WAY * SHORTEST_WAY:
            force = self._force
            rise = hypot(force[0] - earlier[0], force[1] - earlier[1], force[2] - earlier[2])
            seen = rise / squared_way**0.5
            if touched:  # part of the first step of a contact was free
                self._stiffness, self._seen = max(seen, self._stiffness) if self._seen else seen, True
            elif rise > LEAST_RISE:  # the robot is at least so stiff
                self._coupling = max(self._coupling, seen)
        if not self._touches:
            self._stiffness, self._seen = self._coupling, False

    def affordable(self, target: Vector, here: Vector, tank: float) -> Vector:
        """The farthest point from `here` towards `target` [m] that the tank [J] can pay for."""
        if not self._touches:
            return self._free(target, here, tank)
        x, y, z = target[0] - here[0], target[1] - here[1], target[2] - here[2]
        squared = x * x + y * y + z * z
        if squared == 0.0 and tank >= 0.0:
            return target
        force = self._force
        against = -(force[0] * x + force[1] * y + force[2] * z)
        jump = max(0.0, 0.5 * (self._force_range * squared**0.5 - against))  # by the mean of this force and the range
        share = affordable_share(against, 0.5 * CAUTION * self._stiffness * squared, jump, tank)
        if against < 0.0:  # the step leads out of the wall
            share = max(share, min(1.0, LONGEST_RETREAT / hypot(x, y, z)))
        if share == 1.0:
            return target
        if against < 0.0:
            return (here[0] + share * x, here[1] + share * y, here[2] + share * z)
        out = self._sliding.normal_part(force)
        pressed = out[0] * out[0] + out[1] * out[1] + out[2] * out[2]
        back = (1.0 - share) * against / pressed
        if tank < 0.0:  # yielding to the wall pays the debt back
            back += min(-tank / pressed, max(LONGEST_RETREAT, squared**0.5) / pressed**0.5)
        return (target[0] + back * out[0], target[1] + back * out[1], target[2] + back * out[2])

    def _free(self, target: Vector, here: Vector, tank: float) -> Vector:
        """As `affordable`, in free space."""
        if tank < 0.0 and self._outside is not None:
            place, out = self._outside
            depth = sum((p - t) * n for p, t, n in zip(place, target, out, strict=True))
            if depth > 0.0:
                target = (target[0] + depth * out[0], target[1] + depth * out[1], target[2] + depth * out[2])
        x, y, z = target[0] - here[0], target[1] - here[1], target[2] - here[2]
        way = hypot(x, y, z)
        rise, jump = 0.5 * CAUTION * self._coupling * way * way, 0.5 * self._force_range * way
        share = affordable_share(0.0, rise, jump, max(tank, self._debt))
        return target if share == 1.0 else (here[0] + share * x, here[1] + share * y, here[2] + share * z)


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
    return min(1.0, max(with_jump, root_share(against, rise, tank)))


def _most_gainful_share(against: float, rise: float, jump: float) -> float:
    """The s that minimizes  s against + min(s^2 rise, s jump): the vertex of the parabola, or the whole step."""
    if against >= 0.0:
        return 0.0
    if 2.0 * rise <= -against or against + jump <= -0.25 * against * against / rise:
        return 1.0
    return -0.5 * against / rise
