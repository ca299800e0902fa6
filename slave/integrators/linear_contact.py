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
from weberlink.slave.integrators.oscillation import Oscillation
from weberlink.slave.integrators.problem import MassInContact
from weberlink.slave.scenes.proxy import PARALLEL, multipliers, smallest_push
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

    def event(self, horizon: float) -> tuple[float, bool] | None:
        """When the depth falls to 0, or the force k depth + b rate passes 0 [s]; and whether it is the force.

        The force is such an oscillation too. It falls to 0 before the depth does, if it is not slack.
        """
        stiffness, damping, motion, left = self.plane.stiffness, self.plane.damping, self.oscillation, None
        if damping == 0.0 or self.slack:
            left = motion.first_fall(self.value, self.rate, self.rest, horizon)
        if damping > 0.0:
            sign = -1.0 if self.slack else 1.0
            pull = -motion.squared * (self.value - self.rest) - 2.0 * motion.decay * self.rate
            force, change = stiffness * self.value + damping * self.rate, stiffness * self.rate + damping * pull
            until = horizon if left is None else left
            passed = motion.first_fall(sign * force, sign * change, sign * stiffness * self.rest, until)
            if passed is not None:
                return passed, True
        return None if left is None else (left, False)


Face = tuple[list[Coordinate], list[Coordinate]]  # Depths of the active planes, gaps of those still in reach


class LinearContact:
    """Motion of a mass against planes n_i x + o_i = 0, with unit normals n_i out of the solids.

    Events are: the proxy reaches a plane, a plane is left (its depth falls to 0), and the force of a damped contact
    falls to 0 before that (it must not pull) or rises again. Each is located to rounding. The time between events is
    about half a period of the stiffest contact. The gaps of `planes` are seen from `seen_from`.
    """

    def __init__(self, problem: MassInContact, planes: Sequence[Facing], seen_from: Vector) -> None:
        self._problem = problem
        self._free = problem.oscillation()
        self._planes = planes
        self._normals = [plane.normal for plane in planes]
        self._offsets = [plane.gap - dot(plane.normal, seen_from) for plane in planes]
        self._faces: dict[frozenset[int], Face | None] = {}  # each computed on first use

    def flow(
        self, position: Vector, velocity: Vector, goal: Vector, step: float, drag: Drag | None = None
    ) -> tuple[Vector, Vector] | None:
        """Position and velocity `step` [s] later; None after too many events. Beyond 1e12 there is no contact."""
        if self._problem.body.stiffness == 0.0:
            goal = position  # without stiffness the goal has no effect, but its digits would cancel
        if not (is_near(position) and is_near(velocity) and is_near(goal)):
            return moved(self._free, position, velocity, goal, (), step)
        active = self._active(position)
        switched: frozenset[int] | None = None
        for _ in range(EVENTS_MOST):
            if active not in self._faces:
                self._faces[active] = self._face(sorted(active))
            face = self._faces[active]
            if face is None:  # rounding led to a corner of dependent normals
                return None
            depths, gaps = face
            base, pulled = self._base(goal, step, drag if depths else None)
            presses = [self._press(depth, position, velocity, goal, drag, switched) for depth in depths]
            time, plane, switches = first_event(gaps, presses, base, position, velocity, pulled, step)
            position, velocity = moved(base, position, velocity, pulled, presses, time)
            step -= time
            if plane is None or step <= 0.0:
                return position, velocity
            if switches:
                switched = frozenset([p.coordinate.plane for p in presses if p.slack]) ^ {plane}
            else:
                active, switched = active ^ {plane}, None
        return None

    def _active(self, position: Vector) -> frozenset[int]:
        """The planes that hold a probe at `position`."""
        x, y, z = position
        normals = self._normals
        violations = [
            -(n[0] * x + n[1] * y + n[2] * z + offset) for n, offset in zip(normals, self._offsets, strict=True)
        ]
        if max(violations, default=0.0) <= 0.0:
            return NOTHING
        return frozenset([index for index, depth in smallest_push(violations, normals)[0] if depth > 0.0])

    def _face(self, active: list[int]) -> Face | None:
        """The coordinates while `active` hold the probe; None if more than three do or their normals are dependent."""
        normals = [self._normals[i] for i in active]
        duals: list[Vector] = []
        offsets: list[float] = []
        if active:
            x, y, z = [multipliers([dot(n, unit) for n in normals], normals) for unit in UNITS]
            solved = multipliers([self._offsets[i] for i in active], normals)
            if x is None or y is None or z is None or solved is None:
                return None
            duals, offsets = list(zip(x, y, z, strict=True)), list(solved)
        gaps = []
        for j, n in enumerate(self._normals):
            if j in active:
                continue
            along, offset = ZERO, self._offsets[j]
            for normal, g, q in zip(normals, duals, offsets, strict=True):
                share = dot(n, normal)
                along, offset = add(along, scale(g, share)), offset - share * q
            across = subtract(n, along)
            if dot(across, across) > PARALLEL:
                gaps.append(Coordinate(j, across, offset))
        return [Coordinate(i, scale(g, -1.0), -q) for i, g, q in zip(active, duals, offsets, strict=True)], gaps

    def _base(self, goal: Vector, step: float, drag: Drag | None) -> tuple[Oscillation, Vector]:
        """The oscillation of the proxy and its centre: the control, and friction where there is contact."""
        if drag is None:
            return self._free, goal
        (at, force, grip), (mass, control, _) = drag, self._problem.body
        if control + grip == 0.0:
            grip = WEIGHTLESS * mass / (step * step)
        share, yielding = grip / (control + grip), 1.0 / (control + grip)
        centre = add(add(goal, scale(subtract(at, goal), share)), scale(force, yielding))
        return self._problem.oscillation(grip), centre

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
        plane, problem = self._planes[index], self._problem
        value, rate = coordinate.of(position), dot(vector, velocity)
        loose = plane.stiffness * value + plane.damping * rate < 0.0 if slack is None else index in slack
        if plane.damping > 0.0 and loose:
            return PressedPlane(plane, coordinate, value, rate, coordinate.of(goal), self._free, True)
        stiffness, control = plane.stiffness, problem.body.stiffness
        pull = control * coordinate.of(goal) + (0.0 if drag is None else dot(vector, drag.force))
        held = problem.oscillation(stiffness, plane.damping)
        return PressedPlane(plane, coordinate, value, rate, pull / (control + stiffness), held, False)


def first_event(
    gaps: Sequence[Coordinate],
    presses: Sequence[PressedPlane],
    base: Oscillation,
    position: Vector,
    velocity: Vector,
    goal: Vector,
    step: float,
) -> tuple[float, int | None, bool]:
    """Time of the first event, at most `step`; its plane (None: no event); and whether only the force switches."""
    time, plane, switches = step, None, False
    for gap in gaps:
        reached = base.first_fall(gap.of(position), dot(gap.vector, velocity), gap.of(goal), time)
        if reached is not None and (plane is None or reached < time):  # of two at once the first, as in the proxy
            time, plane = reached, gap.plane
    for press in presses:
        event = press.event(time)
        if event is not None:
            (time, switches), plane = event, press.coordinate.plane
    return time, plane, switches


def moved(
    base: Oscillation, position: Vector, velocity: Vector, goal: Vector, presses: Sequence[PressedPlane], time: float
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
