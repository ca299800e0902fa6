"""A mass on one rough plane, solved from event to event in closed form.

Contact is a spring from the body to its anchor on the surface (see `weberlink.slave.scenes.contact`), so that there are
three linear motions:

    free     the oscillation of the control alone
    stuck    one isotropic oscillation, of control and surface together, about a point between goal and anchor
    sliding  the anchor is x + depth n + mu depth e, in the direction e from the body; the depth oscillates as when
             stuck, and the anchor, on which no force acts, follows the free oscillation

Events are touch, release, slip (the static cone, or the dynamic one while the anchor has not come closer since it last
slid) and stop (the anchor turns back). All but the slip are zeros of one oscillating coordinate. The slip is one too in
each fixed direction; the direction is that of the tangential spring, found by iteration.
"""

from typing import NamedTuple

from weberlink.geometry.vector import ZERO, Vector, add, dot, norm, scale, subtract, unit
from weberlink.slave.integrators.linear_contact import EVENTS_MOST, Oscillators
from weberlink.slave.integrators.oscillation import Oscillation
from weberlink.slave.scenes.contact import RESTICK, FrictionCone
from weberlink.slave.scenes.scene import FARTHEST, Facing

LOOKS = 8  # at the direction of a slip; each squares its error
STRAIGHT = 1e-9  # sine of the largest angle between directions that count as one
TURN = 0.1  # [rad] of the direction of sliding in one piece of motion
LEAST = 5e-324
PIECES_LEAST = 1.0 / 8.0  # shortest such piece, as a share of the step


class Hold(NamedTuple):
    """Where the surface holds the body, and whether the anchor has been dragged and not come closer since."""

    anchor: Vector
    sliding: bool


class Motion(NamedTuple):
    """Position [m], velocity [m/s], the hold of the surface, and the time that is left of the step [s]."""

    position: Vector
    velocity: Vector
    hold: Hold | None
    left: float


class Piece(NamedTuple):
    """Sliding for `time` [s]: where it leads, and whether contact ends there, or the anchor stops."""

    position: Vector
    velocity: Vector
    time: float
    out: bool
    stop: bool


class StickSlip:
    """Motion of a mass against a plane with friction and without damping.

    Exact but for rounding where it slides along straight lines. Where the path along the surface is curved the
    direction of friction turns with it, in pieces of 0.1 rad with the midpoint rule, an eighth of the step or longer.
    """

    __slots__ = ("_body", "_cone", "_free", "_gap", "_held", "_normal", "_share", "_stiffness")

    def __init__(self, oscillators: Oscillators, plane: Facing, seen_from: Vector, cone: FrictionCone) -> None:
        self._body = oscillators.body
        self._cone = cone
        self._normal, self._stiffness = plane.normal, plane.stiffness
        self._gap = plane.gap - dot(plane.normal, seen_from)
        self._free = oscillators.held(0.0, 0.0)
        self._held = oscillators.held(plane.stiffness, 0.0)
        self._share = plane.stiffness / (self._body.stiffness + plane.stiffness)

    def flow(
        self, position: Vector, velocity: Vector, goal: Vector, step: float, hold: Hold | None
    ) -> tuple[Vector, Vector, Hold | None] | None:
        """Position, velocity and hold `step` [s] later; None after too many events. Beyond 1e12 is no contact."""
        if self._body.stiffness == 0.0:
            goal = position  # without stiffness the goal has no effect, but its digits would cancel
        if not all(abs(number) < FARTHEST for vector in (position, velocity, goal) for number in vector):
            return *flown(self._free, position, velocity, goal, step), None
        if hold is None and self._depth(position) > 0.0:
            hold = Hold(self._on_surface(position), False)
        now, dragged, stopped = Motion(position, velocity, hold, step), ZERO, False
        shortest = PIECES_LEAST * step
        for _ in range(EVENTS_MOST):
            if now.hold is None:
                now = self._flight(now, goal)
            elif dragged is ZERO:
                now, dragged = self._stuck(now, now.hold, goal, stopped)
                stopped = False
            else:
                now, dragged = self._slide(now, now.hold, goal, dragged, shortest)
                stopped = dragged is ZERO
            if now.left <= 0.0:
                return now.position, now.velocity, now.hold
        return None

    def _depth(self, x: Vector) -> float:
        n = self._normal
        return -(n[0] * x[0] + n[1] * x[1] + n[2] * x[2] + self._gap)

    def _on_surface(self, x: Vector) -> Vector:
        return add(x, scale(self._normal, self._depth(x)))

    def _along(self, x: Vector) -> Vector:
        """The part of `x` along the surface."""
        n = self._normal
        across = n[0] * x[0] + n[1] * x[1] + n[2] * x[2]
        return (x[0] - across * n[0], x[1] - across * n[1], x[2] - across * n[2])

    def _flight(self, now: Motion, goal: Vector) -> Motion:
        x, v, _, left = now
        touched = self._free.first_fall(-self._depth(x), dot(self._normal, v), -self._depth(goal), left)
        x, v = flown(self._free, x, v, goal, left if touched is None else touched)
        if touched is None:
            return Motion(x, v, None, 0.0)
        return Motion(x, v, Hold(self._on_surface(x), False), left - touched)

    def _stuck(self, now: Motion, hold: Hold, goal: Vector, stopped: bool) -> tuple[Motion, Vector]:
        """The next motion, and the direction in which the anchor then slides; zero if it does not."""
        x, v, _, time = now
        held, (anchor, loose) = self._held, hold
        rest = add(goal, scale(subtract(anchor, goal), self._share))
        depth, sinking, deepest = self._depth(x), -dot(self._normal, v), self._depth(rest)
        spring, centre = self._along(subtract(anchor, x)), self._along(subtract(anchor, rest))
        change = self._along(scale(v, -1.0))
        spared = RESTICK * self._cone.dynamic
        length = norm(spring)
        if loose and length < spared * depth:
            loose = False
        out = held.first_fall(depth, sinking, deepest, time)
        event = time if out is None else out
        closer = None
        if loose and length > 0.0:
            e = scale(spring, 1.0 / length)
            closer = held.first_fall(
                length - spared * depth, dot(e, change) - spared * sinking, dot(e, centre) - spared * deepest, event
            )
            event = event if closer is None else closer
        slip = self._slip(
            (depth, sinking, deepest), (spring, change, centre), event, self._cone.dynamic if loose else None, stopped
        )
        if slip is not None:
            event = slip
        x, v = flown(held, x, v, rest, event)
        if slip is not None:
            spring = self._along(subtract(anchor, x))
            if spring == ZERO:
                spring = self._along(scale(v, -1.0))
            return Motion(x, v, Hold(anchor, True), time - event), ZERO if spring == ZERO else unit(spring)
        if closer is not None:  # in another direction by then it is not close enough yet: the next piece finds out
            still = norm(self._along(subtract(anchor, x))) > spared * self._depth(x) * (1.0 + STRAIGHT)
            return Motion(x, v, Hold(anchor, still), time - event), ZERO
        if out is not None:
            return Motion(x, v, None, time - event), ZERO
        return Motion(x, v, Hold(anchor, loose), 0.0), ZERO

    def _slip(
        self,
        depth: tuple[float, float, float],
        spring: tuple[Vector, Vector, Vector],
        horizon: float,
        dynamic: float | None,
        stopped: bool,
    ) -> float | None:
        """When the tangential spring leaves the cone [s], searched up to `horizon`.

        limit depth - e . spring is no less than limit depth - |spring|, and equal where e is the direction of the
        spring: the zero for the direction at a time outside of the cone is earlier than that time, and a sequence of
        such zeros falls to the slip.

        Args:
            depth, spring: Value, rate and resting point of either.
            dynamic: The limit of a loose anchor; None for the static one.
            stopped: Whether the anchor has just turned: it is on the cone, and comes closer from here.
        """
        limit = self._cone.static if dynamic is None else dynamic
        held, (value, rate, rest) = self._held, spring
        first: float | None = None
        e = self._direction(spring, horizon)
        if e is None:
            return None
        directions = [e, scale(e, -1.0)]
        tilt = max(norm(subtract(part, scale(e, dot(e, part)))) - STRAIGHT * norm(part) for part in spring)
        if tilt > 0.0:
            n = self._normal
            aside = (n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2], n[0] * e[1] - n[1] * e[0])
            directions += [aside, scale(aside, -1.0)]
        for direction in directions:
            for _ in range(LOOKS):
                inside = limit * depth[0] - dot(direction, value)
                closing = limit * depth[1] - dot(direction, rate)
                if stopped and tilt <= 0.0 and dot(direction, value) > 0.0:
                    inside, closing = 0.0, abs(closing) or LEAST
                fall = held.first_fall(
                    inside, closing, limit * depth[2] - dot(direction, rest), horizon if first is None else first
                )
                if fall is None:
                    break
                first = fall
                turned = self._direction(spring, fall) if tilt > 0.0 else None
                if turned is None or norm(subtract(turned, direction)) < STRAIGHT:
                    break
                direction = turned  # noqa: PLW2901 - refined
        return first

    def _direction(self, spring: tuple[Vector, Vector, Vector], time: float) -> Vector | None:
        """Of the tangential spring after `time` [s]; None without any length."""
        value, rate, rest = spring
        a, b, _, _ = self._held.transition(time)
        there = add(rest, add(scale(subtract(value, rest), a), scale(rate, b)))
        length = norm(there)
        return None if length == 0.0 else scale(there, 1.0 / length)

    def _slide(self, now: Motion, hold: Hold, goal: Vector, toward: Vector, shortest: float) -> tuple[Motion, Vector]:
        """The next motion, and the direction in which the anchor slides on; zero if it stops."""
        x, v, _, left = now
        cone = self._cone.dynamic * max(0.0, self._depth(x))
        across = norm(self._along(subtract(v, scale(toward, dot(v, toward)))))
        if across * left <= STRAIGHT * cone:
            piece = self._dragged(x, v, goal, toward, left, stops=True)
        else:
            time = left if across * left <= TURN * cone else min(left, max(shortest, TURN * cone / across))
            piece = self._dragged(x, v, goal, toward, time, stops=False)
            spring = self._along(subtract(hold.anchor, piece.position))
            middle = add(toward, scale(spring, 1.0 / (norm(spring) or 1.0)))
            if norm(middle) > STRAIGHT:
                piece = self._dragged(x, v, goal, unit(middle), time, stops=False)
        x, v, time, out, stop = piece
        left = left - time if out or stop or time < left else 0.0
        if out:
            return Motion(x, v, None, left), ZERO
        spring, cone = self._along(subtract(hold.anchor, x)), self._cone.dynamic * max(0.0, self._depth(x))
        if norm(spring) > cone:
            toward = unit(spring)
        elif across * time > STRAIGHT * cone:  # the anchor need not have been dragged at all
            return Motion(x, v, Hold(hold.anchor, True), left), ZERO
        anchor = add(self._on_surface(x), scale(toward, cone))
        return Motion(x, v, Hold(anchor, True), left), ZERO if stop else toward

    def _dragged(self, x: Vector, v: Vector, goal: Vector, e: Vector, time: float, *, stops: bool) -> Piece:
        """Sliding with the anchor in the direction `e`; `stops` to end it where the anchor turns back."""
        n, mu, free, held = self._normal, self._cone.dynamic, self._free, self._held
        depth, sinking, aim = self._depth(x), -dot(n, v), self._depth(goal)
        rest = aim * (1.0 - self._share)
        out = held.first_fall(depth, sinking, rest, time)
        end, stop = time if out is None else out, False
        if stops:
            rate = dot(e, v) + mu * sinking
            turn = free.turn(dot(e, x) + mu * depth - dot(e, goal) - mu * aim, rate) if rate < 0.0 else 0.0
            stop, end = turn < end, min(end, turn)
        a, b, c, d = held.transition(end)
        deep, sank = rest + a * (depth - rest) + b * sinking, c * (depth - rest) + d * sinking
        to_anchor = add(n, scale(e, mu))
        anchor, speed = flown(
            free,
            add(x, scale(to_anchor, depth)),
            add(v, scale(to_anchor, sinking)),
            add(goal, scale(to_anchor, aim)),
            end,
        )
        x, v = subtract(anchor, scale(to_anchor, deep)), subtract(speed, scale(to_anchor, sank))
        return Piece(x, v, end, out is not None and not stop, stop)


def flown(
    oscillation: Oscillation, position: Vector, velocity: Vector, centre: Vector, time: float
) -> tuple[Vector, Vector]:
    """Position and velocity of an isotropic oscillation about `centre` after `time` [s]."""
    a, b, c, d = oscillation.transition(time)
    (gx, gy, gz), (u, v, w) = centre, velocity
    x, y, z = position[0] - gx, position[1] - gy, position[2] - gz
    return (
        (gx + a * x + b * u, gy + a * y + b * v, gz + a * z + b * w),
        (c * x + d * u, c * y + d * v, c * z + d * w),
    )
