"""A mass on springs and dampers behind planes, solved from event to event in closed form. Knows no scene, no proxy."""

from collections.abc import Sequence
from math import pi, sqrt
from typing import NamedTuple

from weberlink.geometry.vector import Vector, dot
from weberlink.slave.integrators.contract import Body
from weberlink.slave.integrators.faces import Coordinate, Face, Faces
from weberlink.slave.integrators.oscillation import Oscillation
from weberlink.slave.scenes.scene import FARTHEST, Facing

EVENTS_SPARE = 32
EVENTS_PER_SWING = 8
WEIGHTLESS = 1e-9  # share of m / h^2: a spring too soft to matter, where the control has none to carry a drag
FREE: frozenset[int] = frozenset()


class Drag(NamedTuple):
    """Friction [N] about the point `at` [m]: force - grip (x - at)."""

    at: Vector
    force: Vector
    grip: float


class Press(NamedTuple):
    """The depth of one active plane: value [m], rate [m/s], and the oscillation about `rest` that it follows."""

    plane: Facing
    coordinate: Coordinate
    value: float
    rate: float
    rest: float
    oscillation: Oscillation
    slack: bool

    def leaves(self, horizon: float) -> float | None:
        """When the depth falls to 0 [s]. With a damper the force does so first, unless it is slack."""
        if self.plane.damping > 0.0 and not self.slack:
            return None
        return self.oscillation.first_fall(self.value, self.rate, self.rest, horizon)

    def switches(self, horizon: float) -> float | None:
        """When k depth + b rate, which is such an oscillation too, passes 0 [s]."""
        stiffness, damping, motion = self.plane.stiffness, self.plane.damping, self.oscillation
        if damping == 0.0:
            return None
        sign = -1.0 if self.slack else 1.0
        pull = -motion.squared * (self.value - self.rest) - 2.0 * motion.decay * self.rate
        force, change = stiffness * self.value + damping * self.rate, stiffness * self.rate + damping * pull
        return motion.first_fall(sign * force, sign * change, sign * stiffness * self.rest, horizon)


class Oscillators:
    """The oscillations of one body, made once for each stiffness and damping that is added to its control's."""

    __slots__ = ("_known", "body")

    def __init__(self, body: Body) -> None:
        self.body = body
        self._known: dict[tuple[float, float], Oscillation] = {}

    def held(self, stiffness: float, damping: float) -> Oscillation:
        key = (stiffness, damping)
        if key not in self._known:
            mass, control, brake = self.body
            self._known[key] = Oscillation(mass, control + stiffness, brake + damping)
        return self._known[key]


class LinearContact:
    """Planes, and how a body moves against them.

    Events are: a plane reached by the proxy, a plane left (its depth falls to 0), and the force of a contact with
    damping falling to 0 before that (it may not pull) or rising again. Each is located to rounding. A stretch between
    events lasts about half a swing of the stiffest contact; should there be many more of them (only rounding could
    cause it), the rest of the step keeps the contacts of the last stretch, and as a linear motion stays bounded.
    """

    __slots__ = ("_body", "_events_per_s", "_faces", "_free", "_oscillators", "_planes")

    def __init__(self, oscillators: Oscillators, planes: Sequence[Facing], seen_from: Vector) -> None:
        self._oscillators = oscillators
        self._free = oscillators.held(0.0, 0.0)
        self._planes = planes
        offsets = [plane.gap - dot(plane.normal, seen_from) for plane in planes]
        self._faces = Faces([plane.normal for plane in planes], offsets)
        self._body = oscillators.body
        stiffest = max((plane.stiffness for plane in planes), default=0.0)
        swings_per_s = sqrt((self._body.stiffness + stiffest) / self._body.mass) / pi
        self._events_per_s = EVENTS_PER_SWING * len(planes) * swings_per_s

    def flow(
        self, position: Vector, velocity: Vector, goal: Vector, step: float, drag: Drag | None = None
    ) -> tuple[Vector, Vector]:
        """Position and velocity `step` [s] later. Where a number is beyond use (1e12) nothing is touched."""
        if self._body.stiffness == 0.0:
            goal = position  # it pulls at nothing; but its digits would cancel
        if not all(abs(number) < FARTHEST for vector in (position, velocity, goal) for number in vector):
            return moved(self._free, position, velocity, goal, (), step)
        active = self._faces.active(position)
        switched: frozenset[int] | None = None
        for _ in range(EVENTS_SPARE + int(self._events_per_s * step)):
            face = self._faces.face(active)
            if face is None:  # a corner of dependent normals: rounding took us there
                break
            base, pulled = self._base(face, goal, step, drag)
            presses = [self._press(depth, position, velocity, goal, drag, switched) for depth in face.depths]
            time, plane, switches = first_event(face, presses, base, position, velocity, pulled, step)
            position, velocity = moved(base, position, velocity, pulled, presses, time)
            step -= time
            if plane is None or step <= 0.0:
                return position, velocity
            if switches:
                switched = frozenset([p.coordinate.plane for p in presses if p.slack]) ^ {plane}
            else:
                active, switched = active ^ {plane}, None
        face = self._faces.face(self._faces.active(position))
        assert face is not None  # the smallest push leans on independent normals only
        base, pulled = self._base(face, goal, step, drag)
        presses = [self._press(depth, position, velocity, goal, drag, FREE) for depth in face.depths]
        return moved(base, position, velocity, pulled, presses, step)

    def _base(self, face: Face, goal: Vector, step: float, drag: Drag | None) -> tuple[Oscillation, Vector]:
        """How the proxy moves, and about which point: the control, and friction where there is contact."""
        if drag is None or not face.depths:
            return self._free, goal
        at, force, grip = drag
        control = self._body.stiffness
        if control + grip == 0.0:
            grip = WEIGHTLESS * self._body.mass / (step * step)
        share, yielding = grip / (control + grip), 1.0 / (control + grip)
        return self._oscillators.held(grip, 0.0), (
            goal[0] + share * (at[0] - goal[0]) + yielding * force[0],
            goal[1] + share * (at[1] - goal[1]) + yielding * force[1],
            goal[2] + share * (at[2] - goal[2]) + yielding * force[2],
        )

    def _press(
        self,
        coordinate: Coordinate,
        position: Vector,
        velocity: Vector,
        goal: Vector,
        drag: Drag | None,
        slack: frozenset[int] | None,
    ) -> Press:
        """`slack` names the contacts that give no force; None where that is to be told from where they are."""
        index, vector, _ = coordinate
        plane = self._planes[index]
        value, rate = coordinate.of(position), dot(vector, velocity)
        loose = plane.stiffness * value + plane.damping * rate < 0.0 if slack is None else index in slack
        if plane.damping > 0.0 and loose:
            return Press(plane, coordinate, value, rate, coordinate.of(goal), self._free, True)
        stiffness, control = plane.stiffness, self._body.stiffness
        pull = control * coordinate.of(goal) + (0.0 if drag is None else dot(vector, drag.force))
        held = self._oscillators.held(stiffness, plane.damping)
        return Press(plane, coordinate, value, rate, pull / (control + stiffness), held, False)


def first_event(
    face: Face,
    presses: Sequence[Press],
    base: Oscillation,
    position: Vector,
    velocity: Vector,
    goal: Vector,
    step: float,
) -> tuple[float, int | None, bool]:
    """When something changes at the latest after `step`, at which plane (None: nothing), and if only its force does."""
    time, plane, switches = step, None, False
    for gap in face.gaps:
        reached = base.first_fall(gap.of(position), dot(gap.vector, velocity), gap.of(goal), time)
        if reached is not None and (plane is None or reached < time):  # of two at once the first, as the proxy does
            time, plane = reached, gap.plane
    for press in presses:
        left = press.leaves(time)
        if left is not None:
            time, plane, switches = left, press.coordinate.plane, False
        switch = press.switches(time)
        if switch is not None:
            time, plane, switches = switch, press.coordinate.plane, True
    return time, plane, switches


def moved(
    base: Oscillation,
    position: Vector,
    velocity: Vector,
    goal: Vector,
    presses: Sequence[Press],
    time: float,
) -> tuple[Vector, Vector]:
    """Position and velocity after `time` [s] without an event: all of it as `base`, then the depths as they do."""
    a, b, c, d = base.transition(time)
    gx, gy, gz = goal
    x, y, z = position[0] - gx, position[1] - gy, position[2] - gz
    u, v, w = velocity
    x, y, z, u, v, w = (
        gx + (a * x + b * u),
        gy + (a * y + b * v),
        gz + (a * z + b * w),
        c * x + d * u,
        c * y + d * v,
        c * z + d * w,
    )
    for press in presses:
        rest, offset, rate = press.coordinate.of(goal), press.value, press.rate
        e, f, g, h = press.oscillation.transition(time)
        own = offset - press.rest
        deeper = (press.rest + e * own + f * rate) - (rest + a * (offset - rest) + b * rate)
        faster = (g * own + h * rate) - (c * (offset - rest) + d * rate)
        n = press.plane.normal
        x, y, z = x - deeper * n[0], y - deeper * n[1], z - deeper * n[2]
        u, v, w = u - faster * n[0], v - faster * n[1], w - faster * n[2]
    return (x, y, z), (u, v, w)
