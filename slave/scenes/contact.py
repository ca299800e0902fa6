"""From a penetration to a force: stiffness, damping and friction of one object."""

from dataclasses import dataclass, replace
from math import pi, sin
from typing import Literal, NamedTuple, Self

from pydantic import Field, model_validator

from weberlink.geometry.vector import ZERO, Vector, norm
from weberlink.options import Options
from weberlink.slave.scenes.shape import Shape, UnitVector

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
        self._stiffness = thing.stiffness_n_m
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
            grip = 0.0 if before is not None and self._anchor is not before else self._stiffness
        return Touch(index, depth, normal, self._stiffness, damping, drag, grip)

    def force(self, depth: float, normal: Vector, proxy: Vector, dt: float) -> Vector:
        """Force [N] on the probe that is `depth` [m] inside, `dt` [s] after the last call; `normal` points out."""
        f = self._stiffness * depth
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
        (ax, ay, az), n, k = self._anchor, normal, self._stiffness
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
