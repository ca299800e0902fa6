"""A scene with objects that oscillate, each computed in its own frame."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import pi, sin
from typing import ClassVar

from weberlink.geometry.vector import Vector, add, interpolate, norm, subtract
from weberlink.slave.scenes.contact import ObjectContact, SceneObject, Touch
from weberlink.slave.scenes.derived import DisplacedShape
from weberlink.slave.scenes.proxy import traced
from weberlink.slave.scenes.scene import FARTHEST, Scene, SceneState, Wave


@dataclass(frozen=True, slots=True)
class Sway:
    """Displacement a w(f t + phase) along `direction` from the configured position.

    Args:
        direction: Unit vector.
        amplitude: a [m], from the middle to either end.
        frequency: f [Hz].
        phase: In turns; at 0 it begins in the middle, on its way along `direction`.
        wave: "sine" for a peak speed of 2 pi f a in the middle, "triangle" for a constant speed of 4 f a.
    """

    direction: Vector
    amplitude: float
    frequency: float
    phase: float = 0.0
    wave: Wave = "sine"

    @property
    def speed(self) -> float:
        """The largest [m/s]."""
        return (2.0 * pi if self.wave == "sine" else 4.0) * self.frequency * self.amplitude

    def at(self, time: float) -> Vector:
        """Displacement [m] after `time` [s]."""
        turns = self.frequency * time + self.phase
        share = sin(2.0 * pi * turns) if self.wave == "sine" else 4.0 * abs((turns - 0.25) % 1.0 - 0.5) - 1.0
        x, y, z = self.direction
        way = self.amplitude * share
        return (way * x, way * y, way * z)


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

    Args:
        objects: What there is to touch, in the middle of its motion.
        sways: How each of them moves, or None.
    """

    __slots__ = ("_movers", "_time")

    moves: ClassVar[bool] = True

    def __init__(self, objects: Sequence[SceneObject], sways: Sequence[Sway | None]) -> None:
        shapes = [DisplacedShape(thing.shape) if sway else None for thing, sway in zip(objects, sways, strict=True)]
        moved = [replace(thing, shape=shape or thing.shape) for thing, shape in zip(objects, shapes, strict=True)]
        contacts = [
            MovingContact(thing, shape) if shape else ObjectContact(thing)
            for thing, shape in zip(moved, shapes, strict=True)
        ]
        super().__init__(moved, contacts)
        self._movers = [(shape, sway) for shape, sway in zip(shapes, sways, strict=True) if shape and sway]
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
        """Move the objects one after another, and with each the proxy if it lies on it or in its way."""
        self._time += dt
        for shape, sway in self._movers:
            before, shape.offset = shape.offset, sway.at(self._time)
            proxy = self._proxy.at
            if proxy is not None:
                self._proxy.at = swept(proxy, shape, subtract(shape.offset, before))


def swept(proxy: Vector, shape: DisplacedShape, moved: Vector) -> Vector:
    """Where a proxy is after `shape` has `moved` [m]: the surface pushes it along from where it first meets it.

    In the frame of the shape the proxy travels the opposite way. That path is traced, so that no thin object passes
    through the proxy between two ticks.
    """
    length = norm(moved)
    if length == 0.0:
        return proxy
    start = add(proxy, moved)
    travelled = traced(shape, start, proxy, length)
    return proxy if travelled is None else interpolate(start, proxy, travelled / length)
