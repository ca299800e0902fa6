"""The gate of the teleoperator's end: every command to a robot or an arm leaves through it.

It engages without a jump, bounds speed, place and contact, and stops the robot where a contact is too strong.
"""

from collections.abc import Callable, Sequence
from math import hypot, inf
from typing import Any

from weberlink.compiled import mypyc_attr
from weberlink.geometry.joints import PART, Joints
from weberlink.geometry.vector import Vector, toward

Workspace = tuple[Vector, Vector]

TRIP_PAUSE = 0.5  # The robot follows no sooner than this after a trip [s]
REBOUND = 0.1  # Time for which a robot that has lost contact may be bouncing [s]
NOISE_SHARE = 1.0 / 32.0  # A press that changes by less of its limit may be noise of the sensors. Chosen.
SPRING = 0.5  # What counts as the answer of a press to the command until it is measured; a spring's is at most 1
DAMPED = 2.0  # A larger answer is not that of a spring; measured in motion, that of a robot with inertia is near 1
LEAST_STEP = 1e-3  # Share of the largest press that a command may go in within a tick from rest. Chosen.


@mypyc_attr(allow_interpreted_subclasses=True)
class Approach:
    """Follows a place in bounded steps, part by part; until it has arrived, in smaller ones.

    A part is some axes that have one length: the three of a position, or a single axis of an arm.

    Args:
        start: what left last.
        width: how many axes each part has.
        speed: of each part while it follows [m/s, or rad/s], > 0; may be infinite.
        approach_speed: the same until it has arrived.
        step_toward: the point on the way to the second value that is so far from the first.
    """

    def __init__(
        self,
        start: Joints,
        width: int,
        speed: float,
        approach_speed: float,
        step_toward: Callable[[Any, Any, float], Any] = toward,
    ) -> None:
        if len(start) % width:
            raise ValueError(f"{len(start)} axes are no parts of {width}")
        if not (speed > 0.0 and approach_speed > 0.0):
            raise ValueError(f"speeds must be positive, not {speed!r} and {approach_speed!r}")
        self.spans = [(first, first + width) for first in range(0, len(start), width)]
        self.speed, self.approach_speed, self._step_toward = speed, approach_speed, step_toward
        self.held = start  # what left last
        self.arrived = False  # whether the approach is over

    def advance(self, goal: Joints, step: float) -> Joints:
        """Go on towards a goal, as far as the time `step` [s] allows."""
        held = self.held
        if goal == held:
            self.arrived = True
            return held
        way = (self.speed if self.arrived else self.approach_speed) * step
        moved: Joints = ()
        if len(self.spans) == 1:
            moved = self._step_toward(held, goal, way)
        else:
            for first, last in self.spans:
                moved += self._step_toward(held[first:last], goal[first:last], way)
        self.held = moved
        self.arrived = self.arrived or moved == goal
        return moved


@mypyc_attr(allow_interpreted_subclasses=True)
class Follower(Approach):
    """Follows commands without a jump, and says how much of what is felt there may be shown.

    After an engagement it approaches the command at a limited speed, and follows it without delay once it is there.
    Until then the measured force does not belong to what the operator does, so none of it is shown, but that of a
    contact (`touches`): nobody may press on unfelt. So its `share` fades in there or in a contact, in `ramp` [s]. When
    it is released it holds, and the force fades out. `clipped`: the last command was bounded while following.
    """

    def __init__(
        self,
        start: Joints,
        width: int,
        *,
        speed: float,
        approach_speed: float,
        ramp: float,
        step_toward: Callable[[Any, Any, float], Any] = toward,
    ) -> None:
        super().__init__(start, width, speed, approach_speed, step_toward)
        self._ramp = ramp
        self.share = 0.0
        self.clipped = self.touches = False

    def reset(self) -> None:
        """Start afresh: hold, and show no force."""
        self.arrived = False
        self.share = 0.0

    def release(self) -> None:
        """Nobody leads any more: hold."""
        self.arrived = False

    def hold(self, step: float) -> Joints:
        """The command of a tick in which nobody leads: the last one."""
        self.arrived = self.clipped = self.touches = False
        self.share = max(0.0, self.share - step / self._ramp)
        return self.held

    def pursue(self, commanded: Joints, step: float) -> Joints:
        """The command of a tick in session: the one given, bounded by the speed."""
        held = self.advance(commanded, step)
        if not (self.arrived or self.touches):
            self.share = max(0.0, self.share - step / self._ramp)
        elif self.share < 1.0:
            self.share = min(1.0, self.share + step / self._ramp)
        self.clipped = self.arrived and held != commanded
        return held


TRIP_RETREAT = 0.05  # How far an axis that trips backs off [rad]: 1 cm at the end of 20 cm. Chosen.
CONTACT_SHARE = 0.1  # Share of its largest press that is a contact of an axis: less is friction and noise. Chosen.
DAMPING_MOST = 4.0  # Largest damping of what an axis touches [N m s/rad]: 100 N s/m at the end of 20 cm. Chosen.
FULL_SHARE = 0.95  # Share of the largest press that is all of it: a filtered one that saturates is lower. Chosen.


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

    A robot that is pushed out at v presses with at most about 2 B v more, with the largest B that is provided for:
    `damping` is that, divided by the robot's stiffness [s].
    """

    def __init__(self, most: float, damping: float) -> None:
        self._most = most
        self._noise = NOISE_SHARE * most
        self._damping = damping
        self._acts = False
        self._answer = 0.0  # h, as far as it is known
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

        `press` is the depth of the command below the tip, `before` that of the last tick; `went` how far the command
        went in since. Without `retreats` it stops where the press is too large, and does not go out.
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
    """Bounds the force with which a part of a robot presses on what it touches: its tip, or an axis of an arm.

    Along the contact force, the command may lie at most `most / stiffness` deeper than the robot, so that the robot's
    spring presses with at most `most`, however stiff the contact is; `PressStep` says how it gets there. This holds for
    `REBOUND` after the contact too, unless the operator pulls out: a heavy robot that bounces off a hard wall would
    otherwise be pulled into the next impact. After a damped contact it holds until the command has caught up. Motion
    along the surface and away from it is not bounded.

    Most arms sag under their own weight, which their position control holds by a distance to the command that is no
    contact. So their command goes back only from the force `retreats_from` on; below it, it only goes no deeper.
    Otherwise an arm that takes up a light object would sink.

    Args:
        most: largest contact force [N, or N m], >= 0; 0 for a part that measures none, which is not bounded.
        stiffness: of the robot towards its command [N/m, or N m/rad], > 0; an infinite one is not bounded.
        damping: largest damping of what is touched that is provided for [N s/m, or N m s/rad].
        contact: smallest force that is a contact; less is noise and friction.
    """

    def __init__(
        self, most: float, stiffness: float, *, damping: float, contact: float, retreats_from: float = 0.0
    ) -> None:
        if not most >= 0.0:
            raise ValueError(f"press limits must not be negative: {most}")
        self.reach = inf if stiffness == inf else most / stiffness
        self._step = PressStep(self.reach, damping / stiffness)
        self._contact, self._retreats_from = contact if most > 0.0 else inf, retreats_from
        self.touches = False
        self._out: Joints = ()
        self._left = 0.0
        self._where: Joints = ()
        self._held: Joints = ()

    def forget(self) -> None:
        """The robot holds: what comes next does not follow from what was before."""
        self._where = ()
        self._step.rest()

    def bounded(self, target: Joints, held: Joints, where: Joints, force: Joints, elapsed: float) -> Joints:
        """The target, moved back along the contact force if it lies too deep; itself if it does not.

        `held` is the last command, `where` the robot is, `force` that of the environment on it.
        """
        former, left = (self._held, self._where) if self._where else (held, where)
        self._held, self._where = held, where
        length = hypot(*force)
        self.touches = touches = length >= self._contact
        if touches:
            x, y, z = force if len(force) == PART else (force[0], 0.0, 0.0)
            self._out, self._left = (x / length, y / length, z / length)[: len(force)], REBOUND
        elif self._left <= 0.0 and not self._step.catches_up:
            self._step.rest()
            return target
        out = self._out
        depth, press = _along(target, where, out), _along(held, where, out)
        if depth <= 0.0 and not touches:
            self._left = 0.0
            self._step.rest()
            return target
        self._left -= elapsed
        wanted, before, went = depth - press, _along(former, left, out), _along(held, former, out)
        retreats = length >= self._retreats_from
        excess = wanted - self._step.allowed(wanted, press, before, went, elapsed, retreats=retreats)
        if excess <= 0.0:
            return target
        return tuple([value + excess * way for value, way in zip(target, out, strict=True)])


def _along(start: Joints, end: Joints, direction: Joints) -> float:
    """How far the way from one place to another goes in a direction."""
    if len(direction) == 1:
        return (end[0] - start[0]) * direction[0]
    (a, b, c), (x, y, z), (u, v, w) = direction, start, end
    return (u - x) * a + (v - y) * b + (w - z) * c


def axis_press_limit(most: float, stiffness: float, noise: float) -> PressLimit:
    """The press limit of an axis.

    `most` is the largest torque on the environment [N m], 0 for an axis that measures none; `stiffness` that of its
    position control [N m/rad]; a contact below the `noise` of a measured torque [N m] is none.
    """
    contact = min(most, max(CONTACT_SHARE * most, noise))
    return PressLimit(most, stiffness, damping=DAMPING_MOST, contact=contact, retreats_from=FULL_SHARE * most)


class Guard(Follower):
    """Bounds the commands to a robot, part by part: the tip of a hand's robot, or the axes of an arm.

    When it is released the robot holds, or backs off along the last contact force by `retract` [m], if that is not 0. A
    force above its limit in `trips` [N, or N m] trips it: the robot stops following, and each part with such a force
    backs off along it by `trip_retract` [m, or rad], from both where it is and what it was commanded, for an arm that
    sags lies below a command that is no deeper. It follows again once `TRIP_PAUSE` has passed and the command has left
    the contact: as far along the force as the robot has backed off.

    `workspace` has the least and the largest that is commanded on each axis [m, or rad]. `contact_ticks`: in which the
    press limit held the robot back.
    """

    def __init__(
        self,
        presses: Sequence[PressLimit],
        *,
        workspace: tuple[Joints, Joints],
        trips: Joints,
        speed: float,
        approach_speed: float,
        ramp: float,
        trip_retract: float,
        retract: float = 0.0,
    ) -> None:
        if len(presses) != len(trips):
            raise ValueError(f"{len(presses)} press limits, but {len(trips)} of a trip")
        lower, upper = workspace
        start, width = (0.0,) * len(lower), len(lower) // len(presses)
        super().__init__(start, width, speed=speed, approach_speed=approach_speed, ramp=ramp)
        if not all(low <= high for low, high in zip(lower, upper, strict=True)):
            raise ValueError(f"no range from {lower} to {upper}")
        self.lower, self.upper, self._presses = lower, upper, presses
        # A reading that saturates at the limit is not above it.
        self._trips = [force * (1.0 + 1e-9) for force in trips]
        self._retract, self._trip_retract = retract, trip_retract
        self._retreat_to: Joints | None = None
        self._way_out: tuple[Joints, Joints] | None = None  # End of the retreat, and direction out of the contact
        self._pause = 0.0
        self.contact_ticks = 0

    @property
    def tripped(self) -> bool:
        """Whether a trip keeps the robot from following."""
        return self._way_out is not None

    def place(self, where: Joints) -> None:
        """Start afresh at a place: where the robot is. A trip stays."""
        self.reset()
        self.held = where
        self._retreat_to = None

    def near(self, where: Joints) -> Joints:
        """The last command, each part moved towards the robot until it presses with no more than its limit."""
        moved: Joints = ()
        for (first, last), press in zip(self.spans, self._presses, strict=True):
            moved += toward(where[first:last], self.held[first:last], press.reach)
        return moved

    def is_overloaded(self, force: Joints) -> bool:
        """Whether a force of the environment is above its limit."""
        if len(self._trips) == 1:
            return hypot(*force) > self._trips[0]
        for (first, last), most in zip(self.spans, self._trips):  # noqa: B905, SIM110 - strict and any() cost as much as the loop
            if hypot(*force[first:last]) > most:
                return True
        return False

    def trip(self, force: Joints, where: Joints) -> None:
        """Stop following and back off: a contact is too strong, with this force of the environment on the robot [N, or
        N m].
        """
        self.release()
        outward = self._back_off(force, where, self._trip_retract, self._trips)
        assert self._retreat_to is not None
        self._way_out = self._retreat_to, outward
        self._pause = TRIP_PAUSE

    def retreat(self, force: Joints, where: Joints) -> None:
        """Nobody leads any more: hold, or back off a contact if that was asked for. Arguments as of `trip`."""
        self.release()
        if self._retract > 0.0 and any(force):
            self._back_off(force, where, self._retract, [0.0] * len(self.spans))

    def _back_off(self, force: Joints, where: Joints, way: float, least: Sequence[float]) -> Joints:
        """Have each part whose force is above this go back along it; returns these directions, nothing for others."""
        goal: Joints = ()
        outward: Joints = ()
        for (first, last), limit in zip(self.spans, least, strict=True):
            here, held, length = where[first:last], self.held[first:last], hypot(*force[first:last])
            out: Joints = (0.0,) * (last - first)
            if length > limit:
                out = tuple([value / length for value in force[first:last]])
                far = way + max(0.0, _along(here, held, out))
                held = tuple([value + far * share for value, share in zip(here, out, strict=True)])
            goal += held
            outward += out
        self._retreat_to = self._inside(goal)
        return outward

    def hold(self, step: float) -> Joints:
        """The command of a tick in which nobody leads: the last one, or a step of the retreat."""
        for press in self._presses:
            press.forget()
        return self._wait(step)

    def _wait(self, step: float) -> Joints:
        self._pause -= step
        if self._retreat_to is not None:
            self.advance(self._retreat_to, step)
        return super().hold(step)

    def follow(self, commanded: Joints, where: Joints, force: Joints, step: float) -> Joints:
        """The command of a tick in session: the one given within all limits, or `hold` after a trip or where it is not
        finite.

        `where` the robot is, `force` that of the environment on it.
        """
        if not hypot(*commanded) < inf:
            return self.hold(step)
        bounded: Joints = ()
        held, presses = self.held, self._presses
        if len(presses) == 1:
            bounded = presses[0].bounded(commanded, held, where, force, step)
            self.touches = presses[0].touches
        else:
            self.touches = False
            for (first, last), press in zip(self.spans, presses, strict=True):
                bounded += press.bounded(
                    commanded[first:last], held[first:last], where[first:last], force[first:last], step
                )
                self.touches = self.touches or press.touches
        self.contact_ticks += bounded != commanded
        goal = self._inside(bounded)
        if self._way_out is not None:
            place, outward = self._way_out
            for first, last in self.spans:
                if self._pause > 0.0 or _along(place[first:last], goal[first:last], outward[first:last]) < 0.0:
                    return self._wait(step)
            self._way_out = None
        self._retreat_to = None
        held = self.pursue(goal, step)
        self.clipped = self.arrived and held != bounded
        return held

    def _inside(self, place: Joints) -> Joints:
        for value, low, high in zip(place, self.lower, self.upper):  # noqa: B905 - strict costs as much as the loop
            if value < low or value > high:
                return tuple([min(max(x, a), b) for x, a, b in zip(place, self.lower, self.upper, strict=True)])
        return place
