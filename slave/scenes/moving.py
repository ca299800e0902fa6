"""A scene with objects that oscillate, each computed in its own frame."""

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

from weberlink.geometry.vector import ZERO, Vector, add, interpolate, norm, subtract
from weberlink.slave.scenes.contact import ObjectContact, SceneObject, Touch
from weberlink.slave.scenes.proxy import traced
from weberlink.slave.scenes.scene import FARTHEST, Scene, SceneState
from weberlink.slave.scenes.shape import Shape, Tangent


class DisplacedShape:
    """`shape` displaced by `offset` [m], which may change."""

    __slots__ = ("_shape", "flat", "offset")

    def __init__(self, shape: Shape) -> None:
        self._shape = shape
        self.flat = shape.flat
        self.offset: Vector = ZERO

    def clearance(self, point: Vector) -> float:
        return self._shape.clearance(subtract(point, self.offset))

    def linearise(self, point: Vector) -> tuple[Tangent, ...]:
        return self._shape.linearise(subtract(point, self.offset))


class MovingContact(ObjectContact):
    """A contact in the frame of a moving shape: its friction anchor moves with the shape."""

    __slots__ = ("_shape",)

    def __init__(self, thing: SceneObject, shape: DisplacedShape) -> None:
        super().__init__(thing)
        self._shape = shape

    def touch(self, index: int, depth: float, normal: Vector, proxy: Vector) -> Touch:
        return super().touch(index, depth, normal, subtract(proxy, self._shape.offset))

    def force(self, depth: float, normal: Vector, proxy: Vector, dt: float) -> Vector:
        return super().force(depth, normal, subtract(proxy, self._shape.offset), dt)


class MovingScene(Scene):
    """A scene whose time is the sum of the `dt` of `force`, from 0 at the start and after `reset`.

    Friction and damping act relative to the surface, so friction drags the probe along and a damper resists the speed
    at which surface and probe approach. The motion is prescribed: the probe cannot hold an object up, and the motor of
    the object supplies the energy. `touch` and `facing` are those of the present moment and do not include the velocity
    of a surface, so no integrator takes such a scene.
    """

    __slots__ = ("_movers", "_time")

    moves: ClassVar[bool] = True

    def __init__(self, objects: Sequence[SceneObject]) -> None:
        self._movers = []
        things, contacts = [], []
        for thing in objects:
            if thing.motion is None:
                contacts.append(ObjectContact(thing))
            else:
                shape = DisplacedShape(thing.shape)
                self._movers.append((shape, thing.motion))
                thing = replace(thing, shape=shape)  # noqa: PLW2901 - with the shape that moves
                contacts.append(MovingContact(thing, shape))
            things.append(thing)
        super().__init__(things, contacts)
        self._place(0.0)

    def force(self, position: Vector, dt: float) -> Vector:
        """Reaction of the scene on a probe, `dt` [s] after the last call; see `Scene.force`."""
        if 0.0 < dt < FARTHEST:  # a time without significant digits moves nothing
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
        """Move the objects one after another, and with each the proxy if it lies on it or in its way.

        The surface pushes the proxy along from where it first meets it. In the frame of the shape the proxy travels the
        opposite way. That path is traced, so that no thin object passes through the proxy between two ticks.
        """
        self._time += dt
        for shape, sway in self._movers:
            before, shape.offset = shape.offset, sway.at(self._time)
            moved, proxy = subtract(shape.offset, before), self._proxy.at
            length = norm(moved)
            if proxy is None or length == 0.0:
                continue
            start = add(proxy, moved)
            free = traced(shape, start, proxy, length)
            if free is not None:
                self._proxy.at = interpolate(start, proxy, free / length)
