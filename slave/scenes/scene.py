"""All objects that the probe can touch, and the force that it feels."""

from collections.abc import Sequence
from typing import NamedTuple

from weberlink.geometry.vector import ZERO, Vector, add, distance, interpolate, norm, subtract
from weberlink.slave.scenes.contact import UNTOUCHED, ContactState, ObjectContact, SceneObject, Sway, Touch
from weberlink.slave.scenes.proxy import Proxy, ShapePress, traced
from weberlink.slave.scenes.shape import Shape, Tangent

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
            f = self._contacts[index].force(depth, normal, proxy, dt)
            x, y, z = x + f[0], y + f[1], z + f[2]
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
