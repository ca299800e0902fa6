"""A mass on one rough plane, solved from event to event in closed form.

Contact is a spring from the body to its anchor on the surface (see `weberlink.slave.scenes.scene`), so that there are
three linear motions:

    free     the oscillation of the control alone
    stuck    one isotropic oscillation, of control and surface together, about a point between goal and anchor
    sliding  the anchor is at x + mu depth e along the surface, in the direction e; the depth oscillates as when stuck,
             and the anchor, on which no force acts along the surface, follows the free oscillation

Events are touch, release, slip (the anchor reaches the static cone, or the dynamic one while it has not come closer
since it last slid) and stop (a sliding anchor turns back). All but the slip are zeros of one oscillating coordinate.
The slip is one too in each fixed direction; the direction is that of the tangential spring, found by iteration.

A vector along the surface is a complex number, and the state of the body is its depth and such a vector.
"""

from cmath import rect
from math import atan, atan2, exp, sqrt, tan
from typing import NamedTuple

from weberlink.geometry.vector import ZERO, Vector, scale, subtract, unit
from weberlink.slave.integrators import MassState
from weberlink.slave.integrators.linear_contact import EVENTS_MOST
from weberlink.slave.integrators.oscillation import Oscillation
from weberlink.slave.integrators.problem import MassInContact, Stage, contact_force
from weberlink.slave.scenes.scene import FARTHEST, NOTHING, RESTICK, UNTOUCHED, Facing, FrictionCone, SceneState, Touch

Local = tuple[float, complex]  # Depth, and the components along the surface

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

    anchor: complex | None = None
    toward: complex | None = None
    loose: bool = False
    stopped: bool = False


FREE = Phase()
Piece = tuple[Local, Local, float, Phase | None]  # Position, velocity and time [s] at its end; the phase that follows
Spring = tuple[complex, complex, complex]  # From the body to its anchor: value [m], rate [m/s] and resting point [m]


class StickSlip:
    """Motion of a mass against a plane with friction and without damping.

    Exact but for rounding where it slides along straight lines. Where the path along the surface is curved, the
    direction of friction turns in pieces of 0.1 rad, or an eighth of the step, by the midpoint rule: order 2. The plane
    is seen from the origin.
    """

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
        x, v, aim = self._local(position, gap), self._local(velocity, 0.0), self._local(goal, gap)
        phase, left, straight = FREE, step, True
        _, anchor, sliding = state.contacts[0]
        if anchor is not None:
            phase = Phase(self._local(anchor, gap)[1], None, sliding)
        elif x[0] > 0.0:
            phase = Phase(x[1])
        for _ in range(EVENTS_MOST):
            if phase.anchor is None:
                x, v, time, following = self._flight(x, v, aim, left)
            elif phase.toward is None:
                x, v, time, following = self._stuck(x, v, aim, left, phase.anchor, phase)
            elif self._turns(x, v, left, phase.toward):
                x, v, time, following = self._turning(x, v, aim, left, step / PIECES, phase.toward)
                straight = False
            else:
                x, v, time, following = self._dragged(x, v, aim, left, phase.toward, stops=True)
            left -= time
            phase = phase if following is None else following
            if following is None or left <= 0.0:
                end = self._end(x, v, phase)
                return end if straight else self._problem.kept(start, end, goal)
        return None

    def _turns(self, x: Local, v: Local, left: float, toward: complex) -> bool:
        """Whether the direction to the anchor turns as it is dragged along."""
        across, speed = abs(cross(toward, v[1])), abs(v[1].real) + abs(v[1].imag)
        return across > STRAIGHT * speed and across * left > STRAIGHT * self._cone.dynamic * x[0]

    def _end(self, x: Local, v: Local, phase: Phase) -> Stage:
        position, velocity, scene = self._global(x, self._gap), self._global(v, 0.0), self._problem.scene
        if phase.anchor is None:
            scene.restore(SceneState(position, NOTHING, (UNTOUCHED,), 0.0))
            return Stage(MassState(position, velocity, ZERO), (), 0.0)
        n, k, depth = self._normal, self._stiffness, x[0]
        proxy = (position[0] + depth * n[0], position[1] + depth * n[1], position[2] + depth * n[2])
        anchor = self._global((0.0, phase.anchor), self._gap)
        scene.restore(SceneState(proxy, HELD, ((0.0, anchor, phase.loose),), depth))
        drag = scale(subtract(anchor, proxy), k)
        touch = Touch(0, depth, n, k, 0.0, drag, k if phase.toward is None else 0.0)
        return Stage(MassState(position, velocity, contact_force((touch,), velocity)), (touch,), depth)

    def _local(self, vector: Vector, gap: float) -> Local:
        (x, y, z), n, u, w = vector, self._normal, self._side, self._aside
        along = complex(u[0] * x + u[1] * y + u[2] * z, w[0] * x + w[1] * y + w[2] * z)
        return -(n[0] * x + n[1] * y + n[2] * z + gap), along

    def _global(self, x: Local, gap: float) -> Vector:
        d, p, q, n, u, w = x[0] + gap, x[1].real, x[1].imag, self._normal, self._side, self._aside
        return (p * u[0] + q * w[0] - d * n[0], p * u[1] + q * w[1] - d * n[1], p * u[2] + q * w[2] - d * n[2])

    def _flight(self, x: Local, v: Local, aim: Local, left: float) -> Piece:
        touched = self._free.first_fall(-x[0], -v[0], -aim[0], left)
        x, v = flown(self._free, x, v, aim, left if touched is None else touched)
        return (x, v, left, None) if touched is None else (x, v, touched, Phase(x[1]))

    def _stuck(self, x: Local, v: Local, aim: Local, left: float, anchor: complex, phase: Phase) -> Piece:
        held, loose, cone = self._held, phase.loose, self._cone
        (depth, along), (sinking, speed) = x, v
        centre = aim[0] - aim[0] * self._share, aim[1] + (anchor - aim[1]) * self._share
        deepest, spring = centre[0], (anchor - along, -speed, anchor - centre[1])
        spared, length = RESTICK * cone.dynamic, size(spring[0])
        if loose and length < spared * depth:
            loose = False
        limit = cone.dynamic if loose else cone.static
        # No swing is larger than the energy of the oscillation allows: in calm contact nothing happens.
        squared, offset, away = held.squared, size(spring[2]), spring[0] - spring[2]
        swing = sqrt((depth - deepest) ** 2 + sinking * sinking / squared)
        sway = sqrt(away.real**2 + away.imag**2 + inner(speed, speed) / squared)
        if offset + sway < limit * (deepest - swing) and (not loose or offset - sway > spared * (deepest + swing)):
            x, v = flown(held, x, v, centre, left)
            return x, v, left, Phase(anchor, None, loose)
        out = held.first_fall(depth, sinking, deepest, left)
        time = left if out is None else out
        closer = None
        if loose and length > 0.0:
            value, rate, rest = [inner(spring[0] / length, each) for each in spring]
            closer = held.first_fall(value - spared * depth, rate - spared * sinking, rest - spared * deepest, time)
            time = time if closer is None else closer
        slip = self._slip(limit, (depth, sinking, deepest), spring, time, phase.stopped)
        time = time if slip is None else slip
        x, v = flown(held, x, v, centre, time)
        away = anchor - x[1]
        if slip is not None:
            if abs(away.real) + abs(away.imag) <= ROUNDING * (abs(x[1].real) + abs(x[1].imag)):
                away = -v[1]  # it slips at the touch, and follows the body
            return x, v, time, Phase(anchor, away / (size(away) or 1.0), True)
        if closer is not None:  # in another direction by then, it is not close enough: the next piece finds out
            far = sqrt(away.real**2 + away.imag**2)
            return x, v, time, Phase(anchor, None, far > spared * x[0] * (1.0 + STRAIGHT))
        return x, v, time, Phase(anchor, None, loose) if out is None else FREE

    def _slip(self, limit: float, depth: Vector, spring: Spring, horizon: float, stopped: bool) -> float | None:
        """When the tangential spring leaves the cone [s], whose slope is `limit`.

        limit depth - e . spring is no less than limit depth - |spring|, and equal where e is the direction of the
        spring: the zero for the direction at a time outside of the cone is earlier than that time, and a sequence of
        such zeros falls to the slip. If `stopped`, the anchor is on the cone and comes closer from here.
        """
        held = self._held
        e = direction(held, spring, horizon)
        if e is None:
            return None
        curved = any(abs(cross(e, each)) > STRAIGHT * (abs(each.real) + abs(each.imag)) for each in spring)
        first: float | None = None
        for e in (e, -e, e * 1j, e * -1j) if curved else (e, -e):  # noqa: B020 - refined from each of them
            for _ in range(ITERATIONS):
                value, rate, rest = [inner(e, each) for each in spring]
                inside, closing = limit * depth[0] - value, limit * depth[1] - rate
                if stopped and not curved and value > 0.0:
                    inside, closing = 0.0, abs(closing) or LEAST
                fall = held.first_fall(inside, closing, limit * depth[2] - rest, horizon)
                if fall is None:
                    break
                first = horizon = fall
                refined = direction(held, spring, fall) if curved else None
                if refined is None or abs((refined - e).real) + abs((refined - e).imag) < STRAIGHT:
                    break
                e = refined  # noqa: PLW2901
        return first

    def _turning(self, x: Local, v: Local, aim: Local, left: float, shortest: float, toward: complex) -> Piece:
        """Sliding on while the direction to the anchor turns."""
        mu = self._cone.dynamic
        cone, across = mu * max(0.0, x[0]), abs(cross(toward, v[1]))
        time = left if across * left <= TURN * cone else min(left, max(shortest, TURN * cone / across))
        piece = self._dragged(x, v, aim, time, toward, stops=False)
        turned = trailing(toward, x, piece[0], mu)
        length = size(toward + turned)
        if length > STRAIGHT:
            piece = self._dragged(x, v, aim, time, (toward + turned) / length, stops=False)
            turned = trailing(toward, x, piece[0], mu)
        x, v, time, phase = piece
        if phase is None or phase.anchor is None:
            return piece
        closer = inner(turned, v[1]) + mu * v[0] >= 0.0
        return x, v, time, Phase(x[1] + mu * max(0.0, x[0]) * turned, None if closer else turned, True)

    def _dragged(self, x: Local, v: Local, aim: Local, left: float, toward: complex, *, stops: bool) -> Piece:
        """Sliding with the anchor in one direction; `stops` to end it where the anchor turns back."""
        mu, free, held, (deep, along), (sinking, speed), (below, goal) = (
            self._cone.dynamic,
            self._free,
            self._held,
            x,
            v,
            aim,
        )
        rest = below * (1.0 - self._share)
        out = held.first_fall(deep, sinking, rest, left)
        time, stop = left if out is None else out, False
        if stops:
            rate = inner(toward, speed) + mu * sinking
            turn = free.turn(inner(toward, along - goal) + mu * (deep - below), rate) if rate < 0.0 else 0.0
            stop, time = turn < time, min(time, turn)
        a, b, c, d = held.transition(time)
        depth, sunk = rest + a * (deep - rest) + b * sinking, c * (deep - rest) + d * sinking
        a, b, c, d = free.transition(time)
        # The anchor's motion, and from there back to the body by the new depth.
        away, rate_away = along + mu * deep * toward - goal - mu * below * toward, speed + mu * sinking * toward
        at = goal + mu * below * toward + a * away + b * rate_away
        x, v = (depth, at - mu * depth * toward), (sunk, c * away + d * rate_away - mu * sunk * toward)
        return x, v, time, FREE if out is not None and not stop else Phase(at, None if stop else toward, True, stop)


def inner(a: complex, b: complex) -> float:
    return a.real * b.real + a.imag * b.imag


def cross(a: complex, b: complex) -> float:
    return a.real * b.imag - a.imag * b.real


def size(a: complex) -> float:
    return sqrt(a.real * a.real + a.imag * a.imag)


def direction(oscillation: Oscillation, spring: Spring, time: float) -> complex | None:
    """The direction of the spring after `time` [s]; None without any length."""
    a, b, _, _ = oscillation.transition(time)
    value, rate, rest = spring
    there = rest + a * (value - rest) + b * rate
    length = size(there)
    return there / length if length > 0.0 else None


def trailing(toward: complex, start: Local, end: Local, mu: float) -> complex:
    """The direction from a body to the anchor that it has dragged along a straight way, at first in `toward`.

    The anchor follows a tractrix: the angle between that direction and the way back falls as tan(angle / 2) ~ exp(-way
    / distance).
    """
    back, far = start[1] - end[1], 0.5 * mu * (start[0] + end[0])
    way = size(back)
    if way == 0.0:
        return toward
    back /= way
    angle = atan2(cross(toward, back), inner(toward, back))
    angle = 2.0 * atan(tan(0.5 * angle) * exp(-way / far)) if far > 0.0 else 0.0
    return back * rect(1.0, -angle)


def flown(oscillation: Oscillation, x: Local, v: Local, centre: Local, time: float) -> tuple[Local, Local]:
    """Position and velocity of an isotropic oscillation about `centre` after `time` [s]."""
    a, b, c, d = oscillation.transition(time)
    (deepest, middle), (sinking, speed) = centre, v
    deep, along = x[0] - deepest, x[1] - middle
    return (deepest + a * deep + b * sinking, middle + a * along + b * speed), (
        c * deep + d * sinking,
        c * along + d * speed,
    )
