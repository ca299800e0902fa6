"""A scene with objects that move; only built where a file asks for motion.

Each moving object is computed in its own frame: its shape where it is now, its friction and damping relative to it. So
friction drags the probe along with the surface, and a damper resists the speed at which surface and probe approach.
"""

from collections.abc import Sequence
from dataclasses import replace

from weberlink.geometry.vector import ZERO, Vector, add, norm, subtract
from weberlink.slave.scenes.contact import Contact, SceneObject, Touch
from weberlink.slave.scenes.proxy import along, traced
from weberlink.slave.scenes.scene import FARTHEST, Scene, SceneState
from weberlink.slave.scenes.shape import Shape, Tangent
from weberlink.slave.scenes.sway import Sway


class MovedShape:
    """`shape` displaced by `offset` [m]."""

    __slots__ = ("_shape", "flat", "offset")

    def __init__(self, shape: Shape) -> None:
        self._shape = shape
        self.flat = shape.flat
        self.offset: Vector = ZERO

    def clearance(self, point: Vector) -> float:
        return self._shape.clearance(subtract(point, self.offset))

    def linearise(self, point: Vector) -> tuple[Tangent, ...]:
        return self._shape.linearise(subtract(point, self.offset))


class MovedContact:
    """`contact` in the frame of a moved shape: what it remembers of the proxy moves with the shape."""

    __slots__ = ("_contact", "_shape")

    def __init__(self, contact: Contact, shape: MovedShape) -> None:
        self._contact = contact
        self._shape = shape

    @property
    def state(self) -> object:
        return self._contact.state

    def restore(self, state: object) -> None:
        self._contact.restore(state)

    def touch(self, index: int, depth: float, normal: Vector, proxy: Vector) -> Touch:
        return self._contact.touch(index, depth, normal, subtract(proxy, self._shape.offset))

    def force(self, depth: float, normal: Vector, proxy: Vector, dt: float) -> Vector:
        return self._contact.force(depth, normal, subtract(proxy, self._shape.offset), dt)

    def release(self) -> None:
        self._contact.release()


class MovingScene(Scene):
    """A scene whose time is the sum of the `dt` of `force`, from 0 at the start and after `reset`.

    The motion is prescribed: nothing that the probe does holds an object up, and its motor puts in whatever energy that
    takes. `touch` and `facing` are those of the present moment and know nothing of the velocity of a surface, so no
    integrator takes such a scene.

    Args:
        objects: what there is to touch, where it is in the middle of its motion.
        sways: for each of them how it moves, or None.
    """

    __slots__ = ("_movers", "_time")

    moves = True

    def __init__(self, objects: Sequence[SceneObject], sways: Sequence[Sway | None]) -> None:
        shapes = [MovedShape(thing.shape) if sway else None for thing, sway in zip(objects, sways, strict=True)]
        super().__init__(
            [replace(thing, shape=shape) if shape else thing for thing, shape in zip(objects, shapes, strict=True)]
        )
        self._contacts = [
            MovedContact(contact, shape) if shape else contact
            for contact, shape in zip(self._contacts, shapes, strict=True)
        ]
        self._remembering = [contact for contact in self._contacts if contact.state is not None]
        self._movers = [(shape, sway) for shape, sway in zip(shapes, sways, strict=True) if shape and sway]
        self._time = 0.0
        self._place(0.0)

    def force(self, position: Vector, dt: float) -> Vector:
        """Reaction of the scene on a probe, `dt` [s] after the last call; the rest is that of `Scene`."""
        if 0.0 < dt < FARTHEST:  # [s] here: a time of which no digits are left moves nothing
            self._advance(dt)
        return super().force(position, dt)

    @property
    def state(self) -> SceneState:
        return super().state._replace(time=self._time)

    def restore(self, state: SceneState) -> None:
        super().restore(state)
        self._place(state.time)

    def reset(self) -> None:
        super().reset()
        self._place(0.0)

    def _place(self, time: float) -> None:
        self._time = time
        for shape, sway in self._movers:
            shape.offset = sway.at(time)

    def _advance(self, dt: float) -> None:
        """Moves the objects on, one after another, and with each the proxy if it lies on it or in its way."""
        self._time += dt
        for shape, sway in self._movers:
            before, shape.offset = shape.offset, sway.at(self._time)
            proxy = self._proxy.at
            if proxy is not None:
                self._proxy.at = swept(proxy, shape, subtract(shape.offset, before))


def swept(proxy: Vector, shape: MovedShape, moved: Vector) -> Vector:
    """Where a proxy is after `shape` has `moved` [m]: it is pushed along from where the surface first meets it.

    In the frame of the shape it is the proxy that travels, the other way; that path is traced, so that nothing thin can
    pass through it between two ticks.
    """
    length = norm(moved)
    if length == 0.0:
        return proxy
    start = add(proxy, moved)
    travelled = traced(shape, start, proxy, length)
    return proxy if travelled is None else along(start, proxy, travelled / length)
