"""Equations of motion of the problems, which the reference solvers integrate.

They are written from the physics and share no code with `slave.scenes`. Between events the motion is smooth: a `Phase`
names the surfaces that hold the body and their state. A phase ends where one of its guards falls below zero.

A body held by surfaces with depths d_i and unit normals n_i feels the depths lambda that solve G lambda = d, with the
Gram matrix G of the normals: the multipliers of its projection onto what is free. At right angles lambda = d.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple, Protocol

from weberlink.geometry.vector import Vector, dot, norm, scale, subtract, unit
from weberlink.slave.integrators import ControlledMass
from weberlink_studies.precision.problems import CoulombFriction, HalfSpace, Problem, ProblemSurface

MotionState = Sequence[float]  # position [m] and velocity [m/s], six numbers

BEYOND = 1e-15  # how far [m] a guard must be overstepped: below any accuracy asked for, above rounding


class Guard(NamedTuple):
    """`value` is at least zero during the phase; where it falls below, `successor` makes the next phase."""

    value: Callable[[MotionState], float]
    successor: Callable[[MotionState], "Phase"]


class Phase(Protocol):
    """A stretch of smooth motion."""

    @property
    def guards(self) -> Sequence[Guard]: ...

    def force(self, state: MotionState) -> Vector:
        """Contact force [N]."""
        ...


def beginning(problem: Problem) -> Phase:
    """The phase before anything is touched; a body that starts on a surface goes on from there at once."""
    rubbing = [surface for surface in problem.surfaces if surface.friction is not None]
    if not rubbing:
        return Held(problem.surfaces, (), ())
    if len(problem.surfaces) > 1 or not isinstance(rubbing[0].solid, HalfSpace):
        raise ValueError(f"{problem.name}: friction is solved on one half-space only")
    return Apart(rubbing[0])


def rate(body: ControlledMass, goal: Vector, phase: Phase, state: MotionState) -> list[float]:
    """d(state)/dt of m a = k (goal - x) - c v + f."""
    x, y, z, u, v, w = state
    force = phase.force(state)
    return [
        u,
        v,
        w,
        (body.stiffness * (goal[0] - x) - body.damping * u + force[0]) / body.mass,
        (body.stiffness * (goal[1] - y) - body.damping * v + force[1]) / body.mass,
        (body.stiffness * (goal[2] - z) - body.damping * w + force[2]) / body.mass,
    ]


def inside(surface: ProblemSurface, state: MotionState) -> tuple[float, Vector]:
    """How deep [m] the body is in one surface, and the unit normal out of it there."""
    solid = surface.solid
    if isinstance(solid, HalfSpace):
        n, p = solid.normal, solid.point
        return n[0] * (p[0] - state[0]) + n[1] * (p[1] - state[1]) + n[2] * (p[2] - state[2]), n
    x, y, z = state[0] - solid.center[0], state[1] - solid.center[1], state[2] - solid.center[2]
    r = sqrt(x * x + y * y + z * z)
    sign = -1.0 if solid.hollow else 1.0
    return sign * (solid.radius - r), (sign * x / r, sign * y / r, sign * z / r)


def solved(normals: Sequence[Vector], right: Sequence[float]) -> list[float]:
    """G lambda = right for one or two normals."""
    if len(normals) == 1:
        return [right[0]]
    if len(normals) == 2:
        g = dot(normals[0], normals[1])
        rest = 1.0 - g * g
        return [(right[0] - g * right[1]) / rest, (right[1] - g * right[0]) / rest]
    raise ValueError("at most two surfaces hold the body at once in these equations")


@dataclass(frozen=True)
class Held:
    """Surfaces without friction: `held` push, except those `slack` of them whose damper would have to pull."""

    surfaces: tuple[ProblemSurface, ...]
    held: tuple[int, ...]
    slack: tuple[int, ...]

    @property
    def guards(self) -> Sequence[Guard]:
        guards = [self._touch(i) for i in range(len(self.surfaces)) if i not in self.held]
        for i in self.held:
            guards.append(self._release(i))
            if self.surfaces[i].damping > 0.0:
                guards.append(self._tighten(i) if i in self.slack else self._slacken(i))
        return guards

    def force(self, state: MotionState) -> Vector:
        x = y = z = 0.0
        for i, (push, n) in self._pushes(state).items():
            if i not in self.slack:
                x, y, z = x + push * n[0], y + push * n[1], z + push * n[2]
        return (x, y, z)

    def _depths(self, state: MotionState) -> tuple[list[float], list[Vector]]:
        """lambda of each held surface, and its normal."""
        if not self.held:
            return [], []
        depths, normals = zip(*(inside(self.surfaces[i], state) for i in self.held), strict=True)
        return solved(normals, depths), list(normals)

    def _pushes(self, state: MotionState) -> dict[int, tuple[float, Vector]]:
        """k lambda + b d(lambda)/dt of each held surface, whatever its sign, and its normal."""
        depths, normals = self._depths(state)
        if not depths:
            return {}
        velocity = (state[3], state[4], state[5])
        rates = solved(normals, [-dot(n, velocity) for n in normals])
        return {
            i: (self.surfaces[i].stiffness * depth + self.surfaces[i].damping * speed, n)
            for i, depth, speed, n in zip(self.held, depths, rates, normals, strict=True)
        }

    def _touch(self, i: int) -> Guard:
        def clearance(state: MotionState) -> float:
            depth, n = inside(self.surfaces[i], state)
            depths, normals = self._depths(state)
            return BEYOND - depth + sum(dot(n, m) * other for other, m in zip(depths, normals, strict=True))

        return Guard(clearance, lambda _: Held(self.surfaces, (*self.held, i), self.slack))

    def _release(self, i: int) -> Guard:
        where = self.held.index(i)
        held = tuple(j for j in self.held if j != i)
        slack = tuple(j for j in self.slack if j != i)
        return Guard(lambda state: self._depths(state)[0][where], lambda _: Held(self.surfaces, held, slack))

    def _slacken(self, i: int) -> Guard:
        return Guard(
            lambda state: self._pushes(state)[i][0], lambda _: Held(self.surfaces, self.held, (*self.slack, i))
        )

    def _tighten(self, i: int) -> Guard:
        slack = tuple(j for j in self.slack if j != i)
        beyond = BEYOND * self.surfaces[i].stiffness
        return Guard(lambda state: beyond - self._pushes(state)[i][0], lambda _: Held(self.surfaces, self.held, slack))


@dataclass(frozen=True)
class Apart:
    """Before or after a touch with friction."""

    surface: ProblemSurface

    @property
    def guards(self) -> Sequence[Guard]:
        return [
            Guard(
                lambda state: BEYOND - inside(self.surface, state)[0],
                lambda state: Anchored(self.surface, (state[0], state[1], state[2]), sliding=False),
            )
        ]

    def force(self, state: MotionState) -> Vector:  # noqa: ARG002
        return (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Anchored:
    """The surface holds the body at a fixed `anchor`; with `sliding`, only within the dynamic cone and for a moment."""

    surface: ProblemSurface
    anchor: Vector
    sliding: bool

    @property
    def guards(self) -> Sequence[Guard]:
        cone = friction(self.surface)
        limit = cone.dynamic if self.sliding else cone.static

        def hold(state: MotionState) -> float:
            return limit * inside(self.surface, state)[0] + BEYOND - norm(self._offset(state))

        def spared(state: MotionState) -> float:
            threshold = cone.restick * cone.dynamic * inside(self.surface, state)[0]
            return norm(self._offset(state)) - threshold

        guards = [leaving(self.surface), Guard(hold, self._slide)]
        if self.sliding:
            guards.append(Guard(spared, lambda _: Anchored(self.surface, self.anchor, sliding=False)))
        return guards

    def force(self, state: MotionState) -> Vector:
        depth, n = inside(self.surface, state)
        k, t = self.surface.stiffness, self._offset(state)
        return (k * (depth * n[0] + t[0]), k * (depth * n[1] + t[1]), k * (depth * n[2] + t[2]))

    def _offset(self, state: MotionState) -> Vector:
        """From the body to the anchor, along the surface."""
        n = inside(self.surface, state)[1]
        away = subtract(self.anchor, (state[0], state[1], state[2]))
        return subtract(away, scale(n, dot(away, n)))

    def _slide(self, state: MotionState) -> Phase:
        return Dragged(self.surface, unit(self._offset(state)))


@dataclass(frozen=True)
class Dragged:
    """The anchor is dragged along at the dynamic cone, in the unit direction `toward` as seen from the body.

    The direction is constant where the body slides along a line, which is all that is solved here.
    """

    surface: ProblemSurface
    toward: Vector

    @property
    def guards(self) -> Sequence[Guard]:
        cone = friction(self.surface)

        def dragging(state: MotionState) -> float:
            """How fast a fixed anchor would leave the dynamic cone [m/s]."""
            velocity = (state[3], state[4], state[5])
            deeper = -dot(inside(self.surface, state)[1], velocity)
            return -dot(self.toward, velocity) - cone.dynamic * deeper

        def stop(state: MotionState) -> Phase:
            offset = cone.dynamic * inside(self.surface, state)[0]
            anchor = tuple(state[axis] + offset * self.toward[axis] for axis in range(3))
            return Anchored(self.surface, (anchor[0], anchor[1], anchor[2]), sliding=True)

        return [leaving(self.surface), Guard(dragging, stop)]

    def force(self, state: MotionState) -> Vector:
        depth, n = inside(self.surface, state)
        f, share = self.surface.stiffness * depth, friction(self.surface).dynamic
        t = self.toward
        return (f * (n[0] + share * t[0]), f * (n[1] + share * t[1]), f * (n[2] + share * t[2]))


def leaving(surface: ProblemSurface) -> Guard:
    return Guard(lambda state: inside(surface, state)[0], lambda _: Apart(surface))


def friction(surface: ProblemSurface) -> CoulombFriction:
    assert surface.friction is not None
    return surface.friction
