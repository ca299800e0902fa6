"""Protects the robot from decoded commands: engagement without a jump, limits of speed, place and contact, trips."""

from collections.abc import Callable
from math import hypot, inf
from typing import Generic, TypeVar

from weberlink.control.contract import LEAST_CONTACT
from weberlink.geometry.vector import ZERO, Vector, add, distance, dot, norm, scale, subtract, unit

Workspace = tuple[Vector, Vector]
Place = TypeVar("Place", bound=tuple[float, ...])
"""A position or an orientation."""

TRIP_PAUSE = 0.5
"""The robot follows no sooner than this after a trip [s]."""


REBOUND = 0.1
"""Time for which a robot that has lost contact may be bouncing [s]."""
NOISE_SHARE = 1.0 / 32.0
"""A press that changes by less of its limit tells nothing: it may be noise of the sensors. Chosen."""
SPRING = 0.5
"""What counts as the answer of a press to the command until it is measured; that of a spring alone is 1 at most."""
DAMPED = 2.0
"""The answer above which it is not that of a spring; measured in motion, that of a robot with inertia is near 1."""
LEAST_STEP = 1e-3
"""Share of the largest press that a command may go in within a tick from rest. Chosen."""
DAMPING_MOST = 100.0
"""Largest damping of a surface that the press limit provides for [N s/m]. Chosen."""


class Follower(Generic[Place]):
    """Follows commands without a jump.

    After an engagement it approaches the command at a limited speed, and follows it without delay once it is there.
    Until then the measured force does not belong to what the operator does, so none of it is shown; afterwards it fades
    in. When it is released it holds, and the force fades out.
    """

    __slots__ = ("_approach_speed", "_following", "_held", "_ramp", "_share", "_speed", "_toward", "clipped")

    def __init__(
        self,
        start: Place,
        toward: Callable[[Place, Place, float], Place],
        *,
        speed: float,
        approach_speed: float,
        ramp: float,
    ) -> None:
        """Make the follower.

        Args:
            start: what to hold until it is told otherwise.
            toward: the point on the way from the first place to the second, at most so far from the first.
            speed: largest speed while following [m/s, or rad/s], > 0.
            approach_speed: speed of the approach [m/s, or rad/s], > 0.
            ramp: time in which what is felt fades in [s], > 0.
        """
        self._toward = toward
        self._speed = speed
        self._approach_speed = approach_speed
        self._ramp = ramp
        self._held = start
        self._share = 0.0
        self._following = False
        self.clipped = False

    def reset(self) -> None:
        """Start afresh: hold, and show no force."""
        self._following = False
        self._share = 0.0

    @property
    def following(self) -> bool:
        """Whether the approach is over."""
        return self._following

    def shown(self, felt: Vector) -> Vector:
        """The part of the measured force or torque that may be shown to the operator now."""
        share = self._share
        return felt if share == 1.0 else (felt[0] * share, felt[1] * share, felt[2] * share)

    @property
    def ramping(self) -> bool:
        """Whether less than all of it is shown."""
        return self._share < 1.0

    def release(self) -> None:
        """Nobody leads any more: hold."""
        self._following = False

    def hold(self, elapsed: float) -> Place:
        """The command of a tick in which nobody leads: the last one."""
        self._following = self.clipped = False
        self._share = max(0.0, self._share - elapsed / self._ramp)
        return self._held

    def pursue(self, commanded: Place, elapsed: float) -> Place:
        """The command of a tick in session: the one given, bounded by the speed."""
        speed = self._speed if self._following else self._approach_speed
        held = self._toward(self._held, commanded, speed * elapsed)
        self._following = self._following or held == commanded
        step = elapsed / self._ramp
        self._share = min(1.0, self._share + step) if self._following else max(0.0, self._share - step)
        self._held = held
        self.clipped = self._following and held != commanded
        return held


class PressStep:
    """How far a command may go into a contact in a tick, so that the robot's spring presses with at most its limit.

    The press is the depth of the command below the tip: the force of the spring, divided by its stiffness Kc. What it
    lacks to the limit is the room. A step of the command by all of the room keeps the limit, if the press follows the
    command as it does in a spring, by no more than the step.

    A robot without inertia passes on the damping of what it touches. At stiffness K <= Kc, damping B and tick T its
    press is p[k] = (K d[k] + B (d[k] - d[k-1]) / T) / Kc, with the depth d of the command below the surface. Steps of
    a times the room give z^2 - (1 - a h) z - a b = 0 with h = (K + B / T) / Kc and b = B / (T Kc). At a = 1 that is
    unstable for b > 1: the command is thrown out of the contact and back into it. At a = 1 / max(1, 2 h), both roots
    are within the unit circle and at least -1/2 for every K, B and T. Therefore:

    - At an excess that was not there a tick ago the command stops. What damping adds to the press ends with that.
    - By how much the press follows a change of the command's speed gives h; it is kept while the limit acts.
    - The command goes 1 / max(1, 2 h) of the room, inwards and outwards. After an excess it goes in at twice its last
      speed at most: it must not meet a damping that it does not know yet with all of the room.

    A robot that is pushed out at v presses with at most about 2 B v more, with the largest B that is provided for.

    Args:
        most: press at the limit, > 0.
        damping: largest damping that is provided for, divided by the robot's stiffness [s].
    """

    __slots__ = ("_acts", "_answer", "_damping", "_most", "_noise", "_went")

    def __init__(self, most: float, damping: float) -> None:
        self._most = most
        self._noise = NOISE_SHARE * most
        self._damping = damping
        self._acts = False
        self._answer = 0.0
        """h, as far as it is known."""
        self._went = 0.0

    @property
    def catches_up(self) -> bool:
        """Whether the command is behind what it follows, at a speed that suits what it has touched."""
        return self._acts and self._answer > DAMPED

    def rest(self) -> None:
        """There is no contact."""
        self._acts = False

    def allowed(
        self, wanted: float, press: float, before: float, went: float, elapsed: float, *, retreats: bool = True
    ) -> float:
        """How far the command may go in, negative for out: `wanted`, or less.

        Args:
            wanted: how far it is to go in.
            press: depth of the command below the tip.
            before: that of the last tick.
            went: how far the command went in from the last tick to this one.
            elapsed: time since the last tick [s].
            retreats: whether it may have to go out; otherwise it stops where the press is too large.
        """
        quickening, change, fastest = went - self._went, press - before, max(abs(went), abs(self._went))
        self._went = went
        if not self._acts:
            self._answer = 0.0
        elif abs(change) > self._noise and change * quickening > 0.0 and 2.0 * abs(quickening) >= fastest:
            damping = self._damping / elapsed if elapsed > 0.0 else 0.0
            self._answer = max(self._answer, min(change / quickening, 1.0 + damping))
        room = self._most - press
        if room < 0.0:
            self._answer = max(self._answer, SPRING)
            room = max(room, min(0.0, self._most - before)) if retreats else 0.0
        if self._answer > 0.0:
            room = min(room / max(1.0, 2.0 * self._answer), 2.0 * fastest + LEAST_STEP * self._most)
        self._acts = wanted > room
        return room if self._acts else wanted


class PressLimit:
    """Bounds the force with which a robot presses on what it touches.

    Along the contact force, the command may lie at most `most / stiffness` deeper than the tip, so that the robot's
    spring presses with at most `most`, however stiff the contact is; `PressStep` says how it gets there. This holds for
    `REBOUND` after the contact too, unless the operator pulls out: a heavy robot that bounces off a hard wall would
    otherwise be pulled into the next impact. After a damped contact it holds until the command has caught up. Motion
    along the surface and away from it is not bounded.

    Args:
        most: largest contact force [N], > 0.
        stiffness: of the robot towards its command [N/m], > 0; an infinite one is not bounded.
    """

    __slots__ = ("_held", "_left", "_out", "_step", "_tip")

    def __init__(self, most: float, stiffness: float) -> None:
        self._step = PressStep(inf if stiffness == inf else most / stiffness, DAMPING_MOST / stiffness)
        self._out: Vector = ZERO
        self._left = 0.0
        self._tip: Vector | None = None
        self._held: Vector = ZERO

    def forget(self) -> None:
        """The robot holds: what comes next does not follow from what was before."""
        self._tip = None
        self._step.rest()

    def bounded(self, target: Vector, held: Vector, tip: Vector, force: Vector, elapsed: float) -> Vector:
        """The target [m], moved back along the contact force if it lies too deep; itself if it does not.

        Args:
            target: position that the robot is to be commanded to [m].
            held: that of the last command [m].
            tip: where the robot is [m].
            force: of the environment on the robot [N].
            elapsed: time since the last call [s].
        """
        former, left = (held, tip) if self._tip is None else (self._held, self._tip)
        self._held, self._tip = held, tip
        x, y, z = force
        length = hypot(x, y, z)
        touches = length >= LEAST_CONTACT
        if touches:
            self._out, self._left = (x / length, y / length, z / length), REBOUND
        elif self._left <= 0.0 and not self._step.catches_up:
            self._step.rest()
            return target
        a, b, c = self._out
        depth = (tip[0] - target[0]) * a + (tip[1] - target[1]) * b + (tip[2] - target[2]) * c
        if depth <= 0.0 and not touches:
            self._left = 0.0
            self._step.rest()
            return target
        self._left -= elapsed
        press = (tip[0] - held[0]) * a + (tip[1] - held[1]) * b + (tip[2] - held[2]) * c
        before = (left[0] - former[0]) * a + (left[1] - former[1]) * b + (left[2] - former[2]) * c
        went = (former[0] - held[0]) * a + (former[1] - held[1]) * b + (former[2] - held[2]) * c
        wanted = depth - press
        excess = wanted - self._step.allowed(wanted, press, before, went, elapsed)
        if excess <= 0.0:
            return target
        return (target[0] + excess * a, target[1] + excess * b, target[2] + excess * c)


class TripGuard(Follower[Place]):
    """A follower that stops when a contact is too strong, backs off, and follows again once it was led out.

    That is once `TRIP_PAUSE` has passed and the command is as far out of the contact as the robot has backed off. A
    subclass sets where to retreat to and which way is out.
    """

    __slots__ = ("_is_beyond", "_nearest", "_pause", "_retreat_to", "_way_out")

    def __init__(
        self,
        start: Place,
        toward: Callable[[Place, Place, float], Place],
        nearest: Callable[[Place], Place],
        is_beyond: Callable[[Place, Place, Place], bool],
        *,
        speed: float,
        approach_speed: float,
        ramp: float,
    ) -> None:
        """Make the guard; arguments as of `Follower`, and these.

        Args:
            nearest: the place nearest to one, where the robot may be commanded to.
            is_beyond: whether the first place lies as far in a direction, the third, as the second.
        """
        super().__init__(start, toward, speed=speed, approach_speed=approach_speed, ramp=ramp)
        self._nearest, self._is_beyond = nearest, is_beyond
        self._retreat_to: Place | None = None
        self._way_out: tuple[Place, Place] | None = None
        """End of the retreat, and the direction out of the contact."""
        self._pause = 0.0

    def place(self, where: Place) -> None:
        """Start afresh at a position: where the robot is. A trip stays."""
        self.reset()
        self._held = where
        self._retreat_to = None

    @property
    def tripped(self) -> bool:
        """Whether a trip keeps the robot from following."""
        return self._way_out is not None

    def hold(self, elapsed: float) -> Place:
        """The command of a tick in which nobody leads: the last one, or a step of the retreat."""
        self._pause -= elapsed
        if self._retreat_to is not None:
            self._held = self._toward(self._held, self._retreat_to, self._approach_speed * elapsed)
        return super().hold(elapsed)

    def follow(self, commanded: Place, elapsed: float) -> Place:
        """The command of a tick in session: the decoded one within range and speed, or `hold` after a trip."""
        goal = self._nearest(commanded)
        if self._way_out is not None:
            place, outward = self._way_out
            if self._pause > 0.0 or not self._is_beyond(goal, place, outward):
                return self.hold(elapsed)
            self._way_out = None
        self._retreat_to = None
        held = self.pursue(goal, elapsed)
        self.clipped = self._following and held != commanded
        return held


class CommandGuard(TripGuard[Vector]):
    """Bounds the commanded position by speed and workspace.

    When it is released the robot holds, or backs off along the last contact force. A trip always backs off. After a
    trip the robot follows again once `TRIP_PAUSE` has passed and the command has left the contact: as far along the
    contact force as the robot has backed off.
    """

    __slots__ = ("_retract", "_trip_retract", "_workspace")

    def __init__(
        self,
        *,
        workspace: Workspace,
        speed: float,
        approach_speed: float,
        ramp: float,
        retract: float = 0.0,
        trip_retract: float = 0.01,
    ) -> None:
        """Make the guard, holding at the origin until it is told where the robot is.

        Args:
            workspace: lowest and highest corner of where the robot may be commanded to [m].
            speed: largest speed while following [m/s], > 0.
            approach_speed: speed of the approach and of a retreat [m/s], > 0.
            ramp: time in which the force fades in and out [s], > 0.
            retract: how far to back off a contact when it is released [m]; 0 to hold.
            trip_retract: how far to back off a contact that trips it [m], > 0.
        """
        super().__init__(ZERO, toward, self._inside, _is_beyond, speed=speed, approach_speed=approach_speed, ramp=ramp)
        self._workspace = workspace
        self._retract = retract
        self._trip_retract = trip_retract

    def release(self, contact_force: Vector = ZERO, where: Vector | None = None) -> None:
        """Nobody leads any more: hold, or retreat along the reaction of the surface.

        Args:
            contact_force: of the environment on the robot [N].
            where: position that the retreat counts from, where the robot is [m]; the last command if not given.
        """
        super().release()
        if self._retract > 0.0:
            self._retreat(contact_force, where, self._retract)

    def trip(self, contact_force: Vector, where: Vector | None = None) -> None:
        """Stop following and back off: the contact is too strong. Arguments as for `release`, of any force > 0."""
        super().release()
        self._retreat(contact_force, where, self._trip_retract)
        assert self._retreat_to is not None
        self._way_out = self._retreat_to, unit(contact_force)
        self._pause = TRIP_PAUSE

    def _retreat(self, contact_force: Vector, where: Vector | None, way: float) -> None:
        if norm(contact_force) > 0.0:
            start = self._held if where is None else where
            self._retreat_to = self._inside(add(start, scale(unit(contact_force), way)))

    def _inside(self, position: Vector) -> Vector:
        low, high = self._workspace
        x, y, z = position
        if low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] <= z <= high[2]:
            return position
        return (min(max(x, low[0]), high[0]), min(max(y, low[1]), high[1]), min(max(z, low[2]), high[2]))


def _is_beyond(goal: Vector, place: Vector, outward: Vector) -> bool:
    return dot(subtract(goal, place), outward) >= 0.0


def toward(start: Vector, goal: Vector, way: float) -> Vector:
    """The goal, or the point on the way to it that is `way` from the start."""
    if distance(start, goal) <= way:
        return goal
    offset = subtract(goal, start)
    return add(start, scale(offset, way / hypot(*offset)))
