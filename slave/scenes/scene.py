"""All objects that the probe can touch, what their surfaces and motions are, and the force that it feels."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import pi, sin
from typing import Literal, NamedTuple, Self

from pydantic import Field, model_validator

from weberlink.geometry.vector import ZERO, Vector, add, distance, interpolate, norm, subtract
from weberlink.options import Options
from weberlink.slave.scenes.proxy import Proxy, ShapePress, traced
from weberlink.slave.scenes.shape import Shape, Tangent, UnitVector

RESTICK = 0.5  # share of the dynamic cone
FASTEST_M_S = 10.0  # Peak speed of a moving object: a centimetre per tick, faster than any robot or hand


class FrictionCone(Options):
    """Coulomb friction: sticks within static x normal force, slides at dynamic x normal force."""

    static: float = Field(ge=0.0, le=2.0)
    dynamic: float = Field(ge=0.0, le=2.0)

    @model_validator(mode="after")
    def check_order(self) -> Self:
        if self.dynamic > self.static:
            raise ValueError(f"dynamic: expected at most static ({self.static}), got {self.dynamic}")
        return self


class Sway(Options):
    """The object oscillates about its configured position, independent of the probe. Time is that of the robot."""

    direction: UnitVector = Field(default=(0.0, 0.0, 1.0), description="of any length; it is normalised")
    amplitude_m: float = Field(gt=0.0, le=10.0, description="from the middle to either end")
    frequency_hz: float = Field(gt=0.0, le=50.0)
    phase_deg: float = Field(
        default=0.0, ge=-360.0, le=360.0, description="at 0 it begins in the middle, moving along the direction"
    )
    wave: Literal["sine", "triangle"] = Field(
        default="sine",
        description="sine: at most 2 pi frequency amplitude fast; triangle: always 4 frequency amplitude",
    )

    @model_validator(mode="after")
    def check_speed(self) -> Self:
        if self.speed > FASTEST_M_S:
            raise ValueError(
                f"amplitude_m, frequency_hz: expected a peak speed of at most {FASTEST_M_S:g} m/s, "
                f"got {self.speed:.3g} m/s"
            )
        return self

    @property
    def speed(self) -> float:
        """The largest [m/s]."""
        return (2.0 * pi if self.wave == "sine" else 4.0) * self.frequency_hz * self.amplitude_m

    def at(self, time: float) -> Vector:
        """Displacement [m] after `time` [s]."""
        turns = self.frequency_hz * time + self.phase_deg / 360.0
        share = sin(2.0 * pi * turns) if self.wave == "sine" else 4.0 * abs((turns - 0.25) % 1.0 - 0.5) - 1.0
        x, y, z = self.direction
        way = self.amplitude_m * share
        return (way * x, way * y, way * z)


@dataclass(frozen=True, slots=True)
class SceneObject:
    """A shape, the properties of its surface and its motion; None means that nothing of it is computed."""

    shape: Shape
    stiffness_n_m: float
    friction: FrictionCone | None = None
    damping_n_s_m: float | None = None
    motion: Sway | None = None

    def softened(self, most: float) -> "SceneObject":
        """This object with a stiffness of at most `most` [N/m]; its damping falls in proportion."""
        share = most / self.stiffness_n_m
        if share >= 1.0:
            return self
        damping = None if self.damping_n_s_m is None else share * self.damping_n_s_m
        return replace(self, stiffness_n_m=most, damping_n_s_m=damping)


class Touch(NamedTuple):
    """Contact with one object at the position of the probe, for a body that has a velocity."""

    owner: int  # index of the object in the scene
    depth: float  # how far the object pushes the probe out along the normal [m], more than 0
    normal: Vector  # unit vector out of the object
    stiffness: float  # of the spring along the normal [N/m]
    damping: float  # along the normal [N s/m]; 0 where the object has none
    drag: Vector  # friction force on the probe [N], along the surface
    grip: float  # stiffness of the drag against motion along the surface [N/m]; 0 while sliding or without friction


ContactState = tuple[float, Vector | None, bool]  # Depth [m], anchor of friction [m], and whether it slides
UNTOUCHED: ContactState = (0.0, None, False)


class ObjectContact:
    """Spring, damper and Coulomb friction of one object.

    Along the normal, f = max(0, k depth + b d(depth)/dt). The rate in `force` is the change of depth since the last
    call, so a commanded position that arrives in steps gives steps of force; the depth before the contact counts as 0,
    which can only underestimate the speed of impact. A body that has a velocity takes k and b from `touch`.

    Friction is a cone on the displacement of the proxy, after Harwin and Melder, "Improved haptic rendering for
    multi-finger manipulation using friction cone based god-objects", Eurohaptics 2002. A decoded position moves in
    steps, so its velocity is useless, but the displacement from the anchor, where the surface holds the probe, is
    defined at every tick. The anchor stays while the displacement is within mu_static * depth; beyond, it is dragged
    along at mu_dynamic * depth. Sliding ends when the displacement falls below half of the dynamic cone (the probe has
    turned back): a pause between two position updates must not bring back the higher static limit.
    """

    def __init__(self, thing: SceneObject) -> None:
        self._depth = 0.0
        self._anchor: Vector | None = None
        self._sliding = False
        self.offset: Vector = ZERO  # Displacement of the object [m]: the anchor moves with it
        self.stiffness = thing.stiffness_n_m
        self._damping = thing.damping_n_s_m
        self._cone = thing.friction
        self.has_memory = self._damping is not None or self._cone is not None  # Whether `state` ever changes

    @property
    def state(self) -> ContactState:
        return (self._depth, self._anchor, self._sliding)

    def restore(self, state: ContactState) -> None:
        self._depth, self._anchor, self._sliding = state

    def touch(self, index: int, depth: float, normal: Vector, proxy: Vector) -> Touch:
        """The contact without its damping force; friction moves on as in `force`."""
        damping, drag, grip = 0.0, ZERO, 0.0
        if self._damping is not None:
            self._depth, damping = depth, self._damping
        if self._cone is not None:
            before = self._anchor
            drag = self._drag(self._cone, depth, normal, proxy)
            grip = 0.0 if before is not None and self._anchor is not before else self.stiffness
        return Touch(index, depth, normal, self.stiffness, damping, drag, grip)

    def force(self, depth: float, normal: Vector, proxy: Vector, dt: float) -> Vector:
        """Force [N] on the probe that is `depth` [m] inside, `dt` [s] after the last call; `normal` points out."""
        f = self.stiffness * depth
        if self._damping is not None:
            if dt > 0.0:
                f = max(0.0, f + self._damping * (depth - self._depth) / dt)
            self._depth = depth
        x, y, z = ZERO if self._cone is None else self._drag(self._cone, depth, normal, proxy)
        return (f * normal[0] + x, f * normal[1] + y, f * normal[2] + z)

    def _drag(self, cone: FrictionCone, depth: float, normal: Vector, proxy: Vector) -> Vector:
        """k (anchor - proxy) along the surface, after the anchor has been dragged along as far as necessary."""
        px, py, pz = proxy[0] - self.offset[0], proxy[1] - self.offset[1], proxy[2] - self.offset[2]
        if self._anchor is None:
            self._anchor = (px, py, pz)
            return ZERO
        (ax, ay, az), n, k = self._anchor, normal, self.stiffness
        x, y, z = ax - px, ay - py, az - pz
        out = x * n[0] + y * n[1] + z * n[2]
        x, y, z = x - n[0] * out, y - n[1] * out, z - n[2] * out
        length = norm((x, y, z))
        dynamic = cone.dynamic * depth
        if length > (dynamic if self._sliding else cone.static * depth):
            self._sliding = True
            share = dynamic / length
            x, y, z = x * share, y * share, z * share
            self._anchor = (px + x, py + y, pz + z)
        elif length < RESTICK * dynamic:
            self._sliding = False
        return (x * k, y * k, z * k)


NOTHING: frozenset[int] = frozenset()
FARTHEST = 1e12  # [m] beyond it squares of distances are too coarse for a contact


class Facing(NamedTuple):
    """A tangent plane of an object: `gap` [m] from the given point (negative inside), `normal` out of it."""

    gap: float
    normal: Vector
    stiffness: float
    damping: float


class SceneState(NamedTuple):
    """What a scene remembers from one position to the next; valid for the scene that made it."""

    proxy: Vector | None
    touched: frozenset[int]
    contacts: tuple[ContactState, ...]
    penetration_depth: float
    time: float = 0.0


class DisplacedShape:
    """`shape` displaced by `offset` [m], which may change."""

    def __init__(self, shape: Shape) -> None:
        self._shape = shape
        self.flat = shape.flat
        self.offset: Vector = ZERO

    def clearance(self, point: Vector) -> float:
        return self._shape.clearance(subtract(point, self.offset))

    def linearise(self, point: Vector) -> tuple[Tangent, ...]:
        return self._shape.linearise(subtract(point, self.offset))


class Scene:
    """The union of `objects`; without objects, free space.

    Never raises and never returns a non-finite force. A position that is not finite, or 1e12 m away, leaves the contact
    as it was, gives zero force and is counted in `rejected`.

    Friction and damping act relative to the surface of an object that moves, so friction drags the probe along and a
    damper resists the speed at which surface and probe approach. The motion is prescribed: the probe cannot hold an
    object up, and the motor of the object supplies the energy. Its time is the sum of the `dt` of `force`, from 0 at
    the start and after `reset`. `touch` and `facing` are those of the present moment and do not include the velocity of
    a surface, so no integrator takes a scene that `moves`.
    """

    def __init__(self, objects: Sequence[SceneObject]) -> None:
        self.objects = tuple(objects)
        self.flat = all(thing.shape.flat for thing in objects)  # `facing` is the same from anywhere
        self.rubs = any(thing.friction is not None and thing.friction.static > 0.0 for thing in objects)
        # Between events a mass in contact moves in closed form. Not so with friction and a damper along the normal
        # alone: the spring of friction then oscillates unlike the depth.
        self.closed_form = self.flat and (not self.rubs or (len(objects) == 1 and not objects[0].damping_n_s_m))
        self.stiffness_n_m = max((thing.stiffness_n_m for thing in objects), default=0.0)  # Limits an integrator's step
        self.damping_n_s_m = max((thing.damping_n_s_m or 0.0 for thing in objects), default=0.0)
        self._contacts = [ObjectContact(thing) for thing in objects]
        self._remembering = [contact for contact in self._contacts if contact.has_memory]
        self._movers: list[tuple[Sway, DisplacedShape, ObjectContact]] = []
        shapes = [thing.shape for thing in objects]
        for index, thing in enumerate(objects):
            if thing.motion is not None:
                shapes[index] = moving = DisplacedShape(thing.shape)
                self._movers.append((thing.motion, moving, self._contacts[index]))
        self.moves = bool(self._movers)  # Whether any object moves by itself
        self._shapes = shapes
        self._proxy = Proxy(shapes)
        self._touched: frozenset[int] = NOTHING
        self._place(0.0)
        self.penetration_depth = 0.0  # Distance [m] between probe and proxy at the last call

    @property
    def proxy(self) -> Vector | None:
        """The proxy; None before the first position."""
        return self._proxy.at

    def force(self, position: Vector, dt: float) -> Vector:
        """Reaction of the scene on a probe at a position [m], `dt` [s] after the last call: the force on it [N], scene
        frame.

        Only damping and objects that move use the time.
        """
        if self._movers and 0.0 < dt < FARTHEST:  # a time without significant digits moves nothing
            self._advance(dt)
        x = y = z = 0.0
        proxy, presses = self._follow(position)
        for index, depth, normal in presses:
            contact = self._contacts[index]
            if contact.has_memory:
                u, v, w = contact.force(depth, normal, proxy, dt)
            else:
                push = contact.stiffness * depth
                u, v, w = push * normal[0], push * normal[1], push * normal[2]
            x, y, z = x + u, y + v, z + w
        if x - x == y - y == z - z == 0.0:
            return (x, y, z)
        self.forget_friction()  # what overflowed must not be remembered
        return ZERO

    def touch(self, position: Vector) -> tuple[Touch, ...]:
        """The contacts at `position` [m], one for each plane, for a body that has a velocity.

        Moves the proxy and friction on as `force` does; `state` and `restore` undo that. Along each normal the body
        feels max(0, stiffness depth + damping d(depth)/dt).
        """
        proxy, presses = self._follow(position)
        touches = [self._contacts[index].touch(index, depth, normal, proxy) for index, depth, normal in presses]
        if presses and len(self._proxy.parts) > len(presses):
            touches = apart(touches, self._proxy.parts)
        return tuple(touches)

    def facing(self, point: Vector) -> list[Facing]:
        """Tangent planes of every object, seen from `point` [m]; changes no state."""
        return [
            Facing(gap, normal, thing.stiffness_n_m, thing.damping_n_s_m or 0.0)
            for thing, shape in zip(self.objects, self._shapes, strict=True)
            for gap, normal in shape.linearise(point)
        ]

    @property
    def state(self) -> SceneState:
        """For `restore`; only contacts with a memory are read."""
        contacts = tuple([contact.state for contact in self._remembering])
        return SceneState(self._proxy.at, self._touched, contacts, self.penetration_depth, self._time)

    def restore(self, state: SceneState) -> None:
        """Go back to where `state` was read."""
        self._proxy.at, self._touched, contacts, self.penetration_depth, time = state
        for contact, remembered in zip(self._remembering, contacts, strict=True):
            contact.restore(remembered)
        if self._movers:
            self._place(time)

    def forget_friction(self) -> None:
        """Start friction anew at the next position; the proxy stays."""
        self._hold(NOTHING)

    def reset(self) -> None:
        """Forget the contact: the next position is accepted even inside a solid."""
        self._proxy.at = None
        self._hold(NOTHING)
        self.penetration_depth = 0.0
        self._place(0.0)

    def _place(self, time: float) -> None:
        self._time = time
        for sway, shape, contact in self._movers:
            shape.offset = contact.offset = sway.at(time)

    def _advance(self, dt: float) -> None:
        """Move the objects one after another, and with each the proxy if it lies on it or in its way.

        The surface pushes the proxy along from where it first meets it. In the frame of the shape the proxy travels the
        opposite way. That path is traced, so that no thin object passes through the proxy between two ticks.
        """
        self._time += dt
        for sway, shape, contact in self._movers:
            before = shape.offset
            shape.offset = contact.offset = sway.at(self._time)
            moved, proxy = subtract(shape.offset, before), self._proxy.at
            length = norm(moved)
            if proxy is None or length == 0.0:
                continue
            start = add(proxy, moved)
            free = traced(shape, start, proxy, length)
            if free is not None:
                self._proxy.at = interpolate(start, proxy, free / length)

    def _follow(self, position: Vector) -> tuple[Vector, Sequence[ShapePress]]:
        """Move the proxy; release objects that are no longer touched."""
        x, y, z = position
        if not (-FARTHEST < x < FARTHEST and -FARTHEST < y < FARTHEST and -FARTHEST < z < FARTHEST):
            return position, ()
        proxy, presses = self._proxy.follow(position)
        if presses:
            self.penetration_depth = distance(proxy, position)
            same = len(presses) == len(self._touched)
            for press in presses:
                same = same and press[0] in self._touched
            if not same:
                self._hold(frozenset([index for index, _, _ in presses]))
        else:
            self.penetration_depth = 0.0
            if self._touched:
                self._hold(NOTHING)
        return proxy, presses

    def _hold(self, touched: frozenset[int]) -> None:
        for index in self._touched - touched:
            self._contacts[index].restore(UNTOUCHED)
        self._touched = touched


def apart(touches: Sequence[Touch], parts: Sequence[ShapePress]) -> list[Touch]:
    """One touch for each plane of a concave corner; the first of them has the friction of all."""
    whole = {touch.owner: touch for touch in touches}
    single: list[Touch] = []
    for owner, depth, normal in parts:
        single.append(whole[owner]._replace(depth=depth, normal=normal))
        whole[owner] = whole[owner]._replace(drag=ZERO, grip=0.0)
    return single
