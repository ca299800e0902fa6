"""A mass behind planes with springs and dampers, solved from event to event in closed form.

The probe is pushed to the nearest point in front of all planes, its proxy: probe = proxy - sum lambda_i n_i over the
active planes, with lambda_i > 0 the depths. With the dual vectors g_i (g_i . n_j = 1 if i = j, else 0, in the span of
the active normals) lambda_i = -(g_i x + q_i). Under an isotropic control and a force sum F_i n_i, where F_i depends on
lambda_i and its rate only, each lambda_i is an independent oscillator, at right angles or not, and the proxy moves as
if there were no contact.
"""

from collections.abc import Sequence
from typing import NamedTuple

from weberlink.geometry.vector import ZERO, Vector, add, dot, scale, subtract
from weberlink.slave.integrators.contract import ControlledMass
from weberlink.slave.integrators.oscillation import Oscillation
from weberlink.slave.scenes.proxy import PARALLEL, SOLVERS, smallest_push
from weberlink.slave.scenes.scene import FARTHEST, NOTHING, Facing

UNITS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
EVENTS_MOST = 128  # in one step, about 2 ms of computing
WEIGHTLESS = 1e-9  # share of m / h^2: a negligible spring to carry a drag where the control has none


class Coordinate(NamedTuple):
    """coordinate(x) = vector . x + offset of `plane`: its depth lambda, or its gap seen from the proxy."""

    plane: int
    vector: Vector
    offset: float

    def of(self, x: Vector) -> float:
        _, vector, offset = self
        return vector[0] * x[0] + vector[1] * x[1] + vector[2] * x[2] + offset


class Face(NamedTuple):
    """The depths of the active planes, and the gaps of those that the proxy can still reach."""

    depths: tuple[Coordinate, ...]
    gaps: tuple[Coordinate, ...]


class Faces:
    """All faces of the planes n_i x + o_i = 0, the n_i unit vectors out of the solids, each computed on first use."""

    __slots__ = ("_known", "_normals", "_offsets")

    def __init__(self, normals: Sequence[Vector], offsets: Sequence[float]) -> None:
        self._normals = normals
        self._offsets = offsets
        self._known: dict[frozenset[int], Face | None] = {}

    def active(self, position: Vector) -> frozenset[int]:
        """The planes that hold a probe at `position`."""
        x, y, z = position
        violations = [
            -(n[0] * x + n[1] * y + n[2] * z + offset) for n, offset in zip(self._normals, self._offsets, strict=True)
        ]
        if max(violations, default=0.0) <= 0.0:
            return NOTHING
        return frozenset([index for index, depth in smallest_push(violations, self._normals) if depth > 0.0])

    def face(self, active: frozenset[int]) -> Face | None:
        """The coordinates while `active` hold the probe; None if more than three do or their normals are dependent."""
        if active not in self._known:
            self._known[active] = self._computed(sorted(active))
        return self._known[active]

    def _computed(self, active: list[int]) -> Face | None:
        if len(active) > len(SOLVERS):
            return None
        normals = [self._normals[i] for i in active]
        duals: list[Vector] = []
        offsets: list[float] = []
        if active:
            solve = SOLVERS[len(active) - 1]
            columns = [solve([dot(n, unit) for n in normals], normals) for unit in UNITS]
            solved = solve([self._offsets[i] for i in active], normals)
            x, y, z = columns
            if x is None or y is None or z is None or solved is None:
                return None
            duals = list(zip(x, y, z, strict=True))
            offsets = list(solved)
        depths = [Coordinate(i, scale(g, -1.0), -q) for i, g, q in zip(active, duals, offsets, strict=True)]
        gaps = []
        for j, n in enumerate(self._normals):
            if j in active:
                continue
            shares = [dot(n, normal) for normal in normals]
            along, offset = ZERO, self._offsets[j]
            for share, g, q in zip(shares, duals, offsets, strict=True):
                along, offset = add(along, scale(g, share)), offset - share * q
            across = subtract(n, along)
            if dot(across, across) > PARALLEL:
                gaps.append(Coordinate(j, across, offset))
        return Face(tuple(depths), tuple(gaps))


class Drag(NamedTuple):
    """Friction [N] about the point `at` [m]: force - grip (x - at)."""

    at: Vector
    force: Vector
    grip: float


class PressedPlane(NamedTuple):
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
    """The oscillations of one mass, cached by the stiffness and damping that are added to those of its control."""

    __slots__ = ("_known", "body")

    def __init__(self, body: ControlledMass) -> None:
        self.body = body
        self._known: dict[tuple[float, float], Oscillation] = {}

    def held(self, stiffness: float, damping: float) -> Oscillation:
        key = (stiffness, damping)
        if key not in self._known:
            mass, control, brake = self.body
            self._known[key] = Oscillation(mass, control + stiffness, brake + damping)
        return self._known[key]


class LinearContact:
    """Motion of a mass against planes.

    Events are: the proxy reaches a plane, a plane is left (its depth falls to 0), and the force of a damped contact
    falls to 0 before that (it must not pull) or rises again. Each is located to rounding. The time between events is
    about half a period of the stiffest contact.
    """

    __slots__ = ("_body", "_faces", "_free", "_oscillators", "_planes")

    def __init__(self, oscillators: Oscillators, planes: Sequence[Facing], seen_from: Vector) -> None:
        self._oscillators = oscillators
        self._free = oscillators.held(0.0, 0.0)
        self._planes = planes
        offsets = [plane.gap - dot(plane.normal, seen_from) for plane in planes]
        self._faces = Faces([plane.normal for plane in planes], offsets)
        self._body = oscillators.body

    def flow(
        self, position: Vector, velocity: Vector, goal: Vector, step: float, drag: Drag | None = None
    ) -> tuple[Vector, Vector] | None:
        """Position and velocity `step` [s] later; None after too many events. Beyond 1e12 there is no contact."""
        if self._body.stiffness == 0.0:
            goal = position  # without stiffness the goal has no effect, but its digits would cancel
        if not (is_near(position) and is_near(velocity) and is_near(goal)):
            return moved(self._free, position, velocity, goal, (), step)
        active = self._faces.active(position)
        switched: frozenset[int] | None = None
        for _ in range(EVENTS_MOST):
            face = self._faces.face(active)
            if face is None:  # rounding led to a corner of dependent normals
                return None
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
        return None

    def _base(self, face: Face, goal: Vector, step: float, drag: Drag | None) -> tuple[Oscillation, Vector]:
        """The oscillation of the proxy and its centre: the control, and friction where there is contact."""
        if drag is None or not face.depths:
            return self._free, goal
        at, force, grip = drag
        control = self._body.stiffness
        if control + grip == 0.0:
            grip = WEIGHTLESS * self._body.mass / (step * step)
        share, yielding = grip / (control + grip), 1.0 / (control + grip)
        centre = add(add(goal, scale(subtract(at, goal), share)), scale(force, yielding))
        return self._oscillators.held(grip, 0.0), centre

    def _press(
        self,
        coordinate: Coordinate,
        position: Vector,
        velocity: Vector,
        goal: Vector,
        drag: Drag | None,
        slack: frozenset[int] | None,
    ) -> PressedPlane:
        """`slack` names the contacts without force; None to find that out from their state."""
        index, vector, _ = coordinate
        plane = self._planes[index]
        value, rate = coordinate.of(position), dot(vector, velocity)
        loose = plane.stiffness * value + plane.damping * rate < 0.0 if slack is None else index in slack
        if plane.damping > 0.0 and loose:
            return PressedPlane(plane, coordinate, value, rate, coordinate.of(goal), self._free, True)
        stiffness, control = plane.stiffness, self._body.stiffness
        pull = control * coordinate.of(goal) + (0.0 if drag is None else dot(vector, drag.force))
        held = self._oscillators.held(stiffness, plane.damping)
        return PressedPlane(plane, coordinate, value, rate, pull / (control + stiffness), held, False)


def first_event(
    face: Face,
    presses: Sequence[PressedPlane],
    base: Oscillation,
    position: Vector,
    velocity: Vector,
    goal: Vector,
    step: float,
) -> tuple[float, int | None, bool]:
    """Time of the first event, at most `step`; its plane (None: no event); and whether only the force switches."""
    time, plane, switches = step, None, False
    for gap in face.gaps:
        reached = base.first_fall(gap.of(position), dot(gap.vector, velocity), gap.of(goal), time)
        if reached is not None and (plane is None or reached < time):  # of two at once the first, as in the proxy
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
    presses: Sequence[PressedPlane],
    time: float,
) -> tuple[Vector, Vector]:
    """Position and velocity after `time` [s] without an event: the motion of `base`, corrected for each depth."""
    a, b, c, d = base.transition(time)
    (gx, gy, gz), (u, v, w) = goal, velocity
    x, y, z = position[0] - gx, position[1] - gy, position[2] - gz
    px, py, pz = gx + (x * a + u * b), gy + (y * a + v * b), gz + (z * a + w * b)
    u, v, w = x * c + u * d, y * c + v * d, z * c + w * d
    for press in presses:
        rest, offset, rate = press.coordinate.of(goal), press.value, press.rate
        e, f, g, h = press.oscillation.transition(time)
        own = offset - press.rest
        deeper = (press.rest + e * own + f * rate) - (rest + a * (offset - rest) + b * rate)
        faster = (g * own + h * rate) - (c * (offset - rest) + d * rate)
        n = press.plane.normal
        px, py, pz = px - n[0] * deeper, py - n[1] * deeper, pz - n[2] * deeper
        u, v, w = u - n[0] * faster, v - n[1] * faster, w - n[2] * faster
    return (px, py, pz), (u, v, w)


def is_near(x: Vector) -> bool:
    """Whether squares of the components are fine enough for a contact; False for NaN."""
    return -FARTHEST < x[0] < FARTHEST and -FARTHEST < x[1] < FARTHEST and -FARTHEST < x[2] < FARTHEST
