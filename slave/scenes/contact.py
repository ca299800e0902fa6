"""From a penetration to a force: stiffness, damping and friction of one object."""

from dataclasses import dataclass, replace
from typing import NamedTuple

from weberlink.geometry.vector import ZERO, Vector, add, dot, norm, scale, subtract
from weberlink.slave.scenes.shape import Shape

RESTICK = 0.5  # share of the dynamic cone


@dataclass(frozen=True, slots=True)
class FrictionCone:
    """Coulomb coefficients, 0 <= dynamic <= static."""

    static: float
    dynamic: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.dynamic <= self.static:
            raise ValueError(f"friction: expected 0 <= dynamic <= static, got {self.dynamic} and {self.static}")


@dataclass(frozen=True, slots=True)
class SceneObject:
    """A shape and the properties of its surface; None means that nothing of it is computed."""

    shape: Shape
    stiffness_n_m: float
    friction: FrictionCone | None = None
    damping_n_s_m: float | None = None

    def __post_init__(self) -> None:
        if not self.stiffness_n_m > 0.0:
            raise ValueError(f"stiffness_n_m: expected more than 0 N/m, got {self.stiffness_n_m}")
        if self.damping_n_s_m is not None and not self.damping_n_s_m >= 0.0:
            raise ValueError(f"damping_n_s_m: expected at least 0 N s/m, got {self.damping_n_s_m}")

    def softened(self, most: float) -> "SceneObject":
        """This object with a stiffness of at most `most` [N/m]; its damping falls in proportion."""
        share = most / self.stiffness_n_m
        if share >= 1.0:
            return self
        damping = None if self.damping_n_s_m is None else share * self.damping_n_s_m
        return replace(self, stiffness_n_m=most, damping_n_s_m=damping)


class Touch(NamedTuple):
    """Contact with one object at the position of the probe, for a body that has a velocity.

    Args:
        owner: Index of the object in the scene.
        depth: How far the object pushes the probe out along `normal` [m], more than 0.
        normal: Unit vector out of the object.
        stiffness: k of the spring along the normal [N/m].
        damping: b along the normal [N s/m]; 0 where the object has none.
        drag: Friction force on the probe [N], along the surface.
        grip: Stiffness of `drag` against motion along the surface [N/m]; 0 while sliding or without friction.
    """

    owner: int
    depth: float
    normal: Vector
    stiffness: float
    damping: float
    drag: Vector
    grip: float


ContactState = tuple[float, Vector | None, bool]
"""Depth [m], anchor of friction [m], and whether it slides."""


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

    __slots__ = ("_anchor", "_cone", "_damping", "_depth", "_sliding", "_stiffness", "has_memory")

    def __init__(self, thing: SceneObject) -> None:
        self.become(thing)
        self._depth = 0.0
        self._anchor: Vector | None = None
        self._sliding = False

    def become(self, thing: SceneObject) -> None:
        """Take the stiffness, damping and friction of an object; the contact stays."""
        self._stiffness = thing.stiffness_n_m
        self._damping = thing.damping_n_s_m
        self._cone = thing.friction
        self.has_memory = self._damping is not None or self._cone is not None
        """Whether `state` ever changes."""

    @property
    def state(self) -> ContactState:
        return (self._depth, self._anchor, self._sliding)

    def restore(self, state: ContactState) -> None:
        self._depth, self._anchor, self._sliding = state

    def release(self) -> None:
        """The probe has left the object: forget the contact."""
        self._depth = 0.0
        self._anchor = None
        self._sliding = False

    def touch(self, index: int, depth: float, normal: Vector, proxy: Vector) -> Touch:
        """The contact without its damping force; friction moves on as in `force`."""
        damping, drag, grip = 0.0, ZERO, 0.0
        if self._damping is not None:
            self._depth, damping = depth, self._damping
        if self._cone is not None:
            before = self._anchor
            drag = self._drag(self._cone, depth, normal, proxy)
            grip = 0.0 if before is not None and self._anchor is not before else self._stiffness
        return Touch(index, depth, normal, self._stiffness, damping, drag, grip)

    def force(self, depth: float, normal: Vector, proxy: Vector, dt: float) -> Vector:
        """Force [N] on the probe that is `depth` [m] inside, `dt` [s] after the last call; `normal` points out."""
        f = self._stiffness * depth
        if self._damping is not None:
            if dt > 0.0:
                f = max(0.0, f + self._damping * (depth - self._depth) / dt)
            self._depth = depth
        pressed = (f * normal[0], f * normal[1], f * normal[2])
        return pressed if self._cone is None else add(pressed, self._drag(self._cone, depth, normal, proxy))

    def _drag(self, cone: FrictionCone, depth: float, normal: Vector, proxy: Vector) -> Vector:
        """k (anchor - proxy) along the surface, after the anchor has been dragged along as far as necessary."""
        if self._anchor is None:
            self._anchor = proxy
            return ZERO
        offset = subtract(self._anchor, proxy)
        tangential = subtract(offset, scale(normal, dot(offset, normal)))
        length = norm(tangential)
        dynamic = cone.dynamic * depth
        if length > (dynamic if self._sliding else cone.static * depth):
            self._sliding = True
            tangential = scale(tangential, dynamic / length)
            self._anchor = add(proxy, tangential)
        elif length < RESTICK * dynamic:
            self._sliding = False
        return scale(tangential, self._stiffness)
