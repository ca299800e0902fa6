"""A mass on one rough plane, solved from event to event in closed form.

Contact is a spring from the body to its anchor on the surface (see `weberlink.slave.scenes.contact`), so that there are
three linear motions:

    free     the oscillation of the control alone
    stuck    one isotropic oscillation, of control and surface together, about a point between goal and anchor
    sliding  the anchor is at x + mu depth e along the surface, in the direction e; the depth oscillates as when stuck,
             and the anchor, on which no force acts along the surface, follows the free oscillation

Events are touch, release, slip (the anchor reaches the static cone, or the dynamic one while it has not come closer
since it last slid) and stop (a sliding anchor turns back). All but the slip are zeros of one oscillating coordinate.
The slip is one too in each fixed direction; the direction is that of the tangential spring, found by iteration.

Vectors here are (depth, p, q), with p and q along the surface.
"""

from math import atan, atan2, cos, exp, sin, sqrt, tan
from typing import NamedTuple

from weberlink.geometry.vector import ZERO, Vector, add, scale, subtract, unit
from weberlink.slave.integrators.contract import MassState
from weberlink.slave.integrators.linear_contact import EVENTS_MOST
from weberlink.slave.integrators.oscillation import Oscillation
from weberlink.slave.integrators.problem import MassInContact, Stage, contact_force
from weberlink.slave.scenes.contact import RESTICK, FrictionCone, Touch
from weberlink.slave.scenes.scene import FARTHEST, NOTHING, Facing, SceneState

Flat = tuple[float, float]
"""Along the surface."""

ITERATIONS = 8  # for the direction of a slip; each squares its error
STRAIGHT = 1e-7  # sine of the largest angle between directions that count as one
ROUNDING = 1e-9  # share of a position [m/m]: a direction over this length has seven digits
TURN = 0.1  # [rad] of the direction of sliding in one piece of motion
PIECES = 8  # of one step, at most, into which it is divided for that
LEAST = 5e-324
HELD = frozenset({0})


class Phase(NamedTuple):
    """The motion from here: free without an anchor, sliding with a direction to the anchor, else stuck.

    `loose` tells that the anchor has slid and not come closer since, `stopped` that it has turned back at this very
    moment.
    """

    anchor: Flat | None = None
    toward: Flat | None = None
    loose: bool = False
    stopped: bool = False


FREE = Phase()
Piece = tuple[Vector, Vector, float, Phase | None]
"""Where a motion leads: position, velocity, its time [s], and the phase that follows; None at the end of the step."""


class StickSlip:
    """Motion of a mass against a plane with friction and without damping.

    Exact but for rounding where it slides along straight lines. Where the path along the surface is curved, the
    direction of friction turns in pieces of 0.1 rad, or an eighth of the step, by the midpoint rule: order 2.

    Args:
        problem: The mass and its scene, of this plane alone.
        plane: Seen from the origin.
        cone: Its friction.
    """

    __slots__ = ("_aside", "_cone", "_free", "_gap", "_held", "_normal", "_problem", "_share", "_side", "_stiffness")

    def __init__(self, problem: MassInContact, plane: Facing, cone: FrictionCone) -> None:
        self._problem = problem
        self._cone = cone
        x, y, z = self._normal = plane.normal
        self._side = unit((0.0, -z, y) if abs(x) < 0.5 else (z, 0.0, -x))
        u, v, w = self._side
        self._aside = (y * w - z * v, z * u - x * w, x * v - y * u)
        self._stiffness = plane.stiffness
        self._gap = plane.gap
        self._free = problem.oscillation()
        self._held = problem.oscillation(plane.stiffness)
        self._share = plane.stiffness / (problem.body.stiffness + plane.stiffness)

    def stepped(self, start: Stage, state: SceneState, goal: Vector, step: float) -> Stage | None:
        """The stage `step` [s] after `start`; None after too many events, and beyond 1e12.

        The scene, whose state at the start gives the anchor of friction, gets the state that a touch would give it.
        """
        (position, velocity, _), gap = start.motion, self._gap
        if self._problem.body.stiffness == 0.0:
            goal = position  # without stiffness the goal has no effect, but its digits would cancel
        if not max(map(abs, (*position, *velocity, *goal))) < FARTHEST:
            return None
        x, v, goal_x = self._local(position, gap), self._local(velocity, 0.0), self._local(goal, gap)
        phase, left, straight = FREE, step, True
        _, anchor, sliding = state.contacts[0]
        if anchor is not None:
            _, p, q = self._local(anchor, gap)
            phase = Phase((p, q), None, sliding)
        elif x[0] > 0.0:
            phase = Phase((x[1], x[2]))
        for _ in range(EVENTS_MOST):
            toward = phase.toward
            if phase.anchor is None:
                x, v, time, following = self._flight(x, v, goal_x, left)
            elif toward is None:
                x, v, time, following = self._stuck(x, v, goal_x, left, phase.anchor, phase)
            else:
                across = abs(toward[0] * v[2] - toward[1] * v[1])
                if (
                    across <= STRAIGHT * (abs(v[1]) + abs(v[2]))
                    or across * left <= STRAIGHT * self._cone.dynamic * x[0]
                ):
                    x, v, time, following = self._dragged(x, v, goal_x, left, toward, stops=True)
                else:
                    x, v, time, following = self._turning(x, v, goal_x, left, step / PIECES, toward)
                    straight = False
            left -= time
            phase = phase if following is None else following
            if following is None or left <= 0.0:
                end = self._end(x, v, phase)
                return end if straight else self._problem.kept(start, end, goal)
        return None

    def _end(self, x: Vector, v: Vector, phase: Phase) -> Stage:
        position, velocity, scene = self._global(x, self._gap), self._global(v, 0.0), self._problem.scene
        if phase.anchor is None:
            scene.restore(SceneState(position, NOTHING, ((0.0, None, False),), 0.0))
            return Stage(MassState(position, velocity, ZERO), (), 0.0)
        n, k, depth = self._normal, self._stiffness, x[0]
        proxy = (position[0] + depth * n[0], position[1] + depth * n[1], position[2] + depth * n[2])
        anchor = self._global((0.0, *phase.anchor), self._gap)
        scene.restore(SceneState(proxy, HELD, ((0.0, anchor, phase.loose),), depth))
        drag = scale(subtract(anchor, proxy), k)
        touch = Touch(0, depth, n, k, 0.0, drag, k if phase.toward is None else 0.0)
        return Stage(MassState(position, velocity, contact_force((touch,), velocity)), (touch,), depth)

    def _local(self, vector: Vector, gap: float) -> Vector:
        (x, y, z), n, u, w = vector, self._normal, self._side, self._aside
        return (
            -(n[0] * x + n[1] * y + n[2] * z + gap),
            u[0] * x + u[1] * y + u[2] * z,
            w[0] * x + w[1] * y + w[2] * z,
        )

    def _global(self, x: Vector, gap: float) -> Vector:
        (d, p, q), n, u, w = x, self._normal, self._side, self._aside
        d += gap
        return (
            p * u[0] + q * w[0] - d * n[0],
            p * u[1] + q * w[1] - d * n[1],
            p * u[2] + q * w[2] - d * n[2],
        )

    def _flight(self, x: Vector, v: Vector, goal: Vector, left: float) -> Piece:
        touched = self._free.first_fall(-x[0], -v[0], -goal[0], left)
        x, v = flown(self._free, x, v, goal, left if touched is None else touched)
        return (x, v, left, None) if touched is None else (x, v, touched, Phase((x[1], x[2])))

    def _stuck(self, x: Vector, v: Vector, goal: Vector, left: float, anchor: Flat, phase: Phase) -> Piece:
        held, loose, cone = self._held, phase.loose, self._cone
        centre = add(goal, scale(subtract((0.0, *anchor), goal), self._share))
        (depth, p, q), (sinking, u, w), (deepest, centre_p, centre_q) = x, v, centre
        spring = Spring((anchor[0] - p, anchor[1] - q), (-u, -w), (anchor[0] - centre_p, anchor[1] - centre_q))
        spared, length = RESTICK * cone.dynamic, spring.length
        if loose and length < spared * depth:
            loose = False
        limit = cone.dynamic if loose else cone.static
        # No swing is larger than the energy of the oscillation allows: in calm contact nothing happens.
        squared = held.squared
        swing = sqrt((depth - deepest) ** 2 + sinking * sinking / squared)
        offset, sway = spring.bounds(squared)
        if offset + sway < limit * (deepest - swing) and (not loose or offset - sway > spared * (deepest + swing)):
            x, v = flown(held, x, v, centre, left)
            return (x, v, left, Phase(anchor, None, loose))
        out = held.first_fall(depth, sinking, deepest, left)
        time = left if out is None else out
        closer = None
        if loose and length > 0.0:
            value, rate, rest = spring.along(spring.value[0] / length, spring.value[1] / length)
            closer = held.first_fall(value - spared * depth, rate - spared * sinking, rest - spared * deepest, time)
            time = time if closer is None else closer
        slip = self._slip(limit, (depth, sinking, deepest), spring, time, phase.stopped)
        time = time if slip is None else slip
        x, v = flown(held, x, v, centre, time)
        if slip is not None:
            p, q = anchor[0] - x[1], anchor[1] - x[2]
            if abs(p) + abs(q) <= ROUNDING * (abs(x[1]) + abs(x[2])):  # it slips at the touch, and follows the body
                p, q = -v[1], -v[2]
            length = sqrt(p * p + q * q) or 1.0
            return (x, v, time, Phase(anchor, (p / length, q / length), True))
        if closer is not None:  # in another direction by then, it is not close enough: the next piece finds out
            far = sqrt((anchor[0] - x[1]) ** 2 + (anchor[1] - x[2]) ** 2)
            return (x, v, time, Phase(anchor, None, far > spared * x[0] * (1.0 + STRAIGHT)))
        return (x, v, time, Phase(anchor, None, loose) if out is None else FREE)

    def _slip(self, limit: float, depth: Vector, spring: "Spring", horizon: float, stopped: bool) -> float | None:
        """When the tangential spring leaves the cone [s], whose slope is `limit`.

        limit depth - e . spring is no less than limit depth - |spring|, and equal where e is the direction of the
        spring: the zero for the direction at a time outside of the cone is earlier than that time, and a sequence of
        such zeros falls to the slip. If `stopped`, the anchor is on the cone and comes closer from here.
        """
        held = self._held
        a, b, _, _ = held.transition(horizon)
        e = spring.direction(a, b)
        if e is None:
            return None
        curved = spring.leaves(e)
        directions: list[Flat] = [e, (-e[0], -e[1])]
        if curved:
            directions += [(-e[1], e[0]), (e[1], -e[0])]
        first: float | None = None
        for p, q in directions:
            for _ in range(ITERATIONS):
                value, rate, rest = spring.along(p, q)
                inside, closing = limit * depth[0] - value, limit * depth[1] - rate
                if stopped and not curved and value > 0.0:
                    inside, closing = 0.0, abs(closing) or LEAST
                fall = held.first_fall(inside, closing, limit * depth[2] - rest, horizon)
                if fall is None:
                    break
                first = horizon = fall
                a, b, _, _ = held.transition(fall)
                e = spring.direction(a, b) if curved else None
                if e is None or abs(e[0] - p) + abs(e[1] - q) < STRAIGHT:
                    break
                p, q = e  # noqa: PLW2901 - refined
        return first

    def _turning(self, x: Vector, v: Vector, goal: Vector, left: float, shortest: float, toward: Flat) -> Piece:
        """Sliding on while the direction to the anchor turns."""
        mu = self._cone.dynamic
        cone, across = mu * max(0.0, x[0]), abs(toward[0] * v[2] - toward[1] * v[1])
        time = left if across * left <= TURN * cone else min(left, max(shortest, TURN * cone / across))
        piece = self._dragged(x, v, goal, time, toward, stops=False)
        turned = trailing(toward, x, piece[0], mu)
        p, q = toward[0] + turned[0], toward[1] + turned[1]
        length = sqrt(p * p + q * q)
        if length > STRAIGHT:
            piece = self._dragged(x, v, goal, time, (p / length, q / length), stops=False)
            turned = trailing(toward, x, piece[0], mu)
        x, v, time, phase = piece
        if phase is None or phase.anchor is None:
            return piece
        cone, (p, q) = mu * max(0.0, x[0]), turned
        closer = p * v[1] + q * v[2] + mu * v[0] >= 0.0
        return (x, v, time, Phase((x[1] + cone * p, x[2] + cone * q), None if closer else turned, True))

    def _dragged(self, x: Vector, v: Vector, goal: Vector, left: float, toward: Flat, *, stops: bool) -> Piece:
        """Sliding with the anchor in one direction; `stops` to end it where the anchor turns back."""
        mu, free, held, (e, f) = self._cone.dynamic, self._free, self._held, toward
        (depth, p, q), (sinking, u, w), (aim, goal_p, goal_q) = x, v, goal
        rest = aim * (1.0 - self._share)
        out = held.first_fall(depth, sinking, rest, left)
        time, stop = left if out is None else out, False
        if stops:
            rate = e * u + f * w + mu * sinking
            turn = free.turn(e * (p - goal_p) + f * (q - goal_q) + mu * (depth - aim), rate) if rate < 0.0 else 0.0
            stop, time = turn < time, min(time, turn)
        a, b, c, d = held.transition(time)
        depth, sinking, deep, speed = (
            rest + a * (depth - rest) + b * sinking,
            c * (depth - rest) + d * sinking,
            depth,
            sinking,
        )
        a, b, c, d = free.transition(time)
        # The anchor's motion, and from there back to the body by the new depth.
        away_p, away_q = p + mu * deep * e - goal_p - mu * aim * e, q + mu * deep * f - goal_q - mu * aim * f
        rate_p, rate_q = u + mu * speed * e, w + mu * speed * f
        at = goal_p + mu * aim * e + a * away_p + b * rate_p, goal_q + mu * aim * f + a * away_q + b * rate_q
        x = (depth, at[0] - mu * depth * e, at[1] - mu * depth * f)
        v = (sinking, c * away_p + d * rate_p - mu * sinking * e, c * away_q + d * rate_q - mu * sinking * f)
        if out is not None and not stop:
            return x, v, time, FREE
        return (x, v, time, Phase(at, None if stop else toward, True, stop))


class Spring(NamedTuple):
    """The tangential spring from the body to its anchor: value [m], rate [m/s] and resting point [m]."""

    value: Flat
    rate: Flat
    rest: Flat

    @property
    def length(self) -> float:
        return sqrt(self.value[0] * self.value[0] + self.value[1] * self.value[1])

    def bounds(self, squared: float) -> Flat:
        """Length of the resting point, and how far an oscillation of this k/m can take the spring from it."""
        (x, y), (u, v), (p, q) = self
        return sqrt(p * p + q * q), sqrt((x - p) ** 2 + (y - q) ** 2 + (u * u + v * v) / squared)

    def along(self, p: float, q: float) -> Vector:
        """The three along one direction."""
        value, rate, rest = self
        return p * value[0] + q * value[1], p * rate[0] + q * rate[1], p * rest[0] + q * rest[1]

    def direction(self, a: float, b: float) -> Flat | None:
        """The direction after the transition with `a` and `b`; None without any length."""
        value, rate, rest = self
        p = rest[0] + a * (value[0] - rest[0]) + b * rate[0]
        q = rest[1] + a * (value[1] - rest[1]) + b * rate[1]
        length = sqrt(p * p + q * q)
        return (p / length, q / length) if length > 0.0 else None

    def leaves(self, direction: Flat) -> bool:
        """Whether it moves out of the line along `direction`."""
        p, q = direction
        return any(abs(p * y - q * x) > STRAIGHT * (abs(x) + abs(y)) for x, y in self)


def trailing(toward: Flat, start: Vector, end: Vector, mu: float) -> Flat:
    """The direction from a body to the anchor that it has dragged along a straight way, at first in `toward`.

    The anchor follows a tractrix: the angle between that direction and the way back falls as tan(angle / 2) ~ exp(-way
    / distance).
    """
    p, q, far = start[1] - end[1], start[2] - end[2], 0.5 * mu * (start[0] + end[0])
    way = sqrt(p * p + q * q)
    if way == 0.0:
        return toward
    p, q = p / way, q / way
    angle = atan2(toward[0] * q - toward[1] * p, toward[0] * p + toward[1] * q)
    angle = 2.0 * atan(tan(0.5 * angle) * exp(-way / far)) if far > 0.0 else 0.0
    c, s = cos(angle), sin(angle)
    return p * c + q * s, q * c - p * s


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
