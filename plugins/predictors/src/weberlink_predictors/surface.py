"""A patch of a contact surface with stiffness, curvature, friction, damping and motion, estimated by the sender.

Both ends compute the force by the god-object method: the god-object, a point that stays on the surface, pulls the probe
with the stiffness. It sticks while the pull is inside the friction cone and otherwise slides after the probe. So both
ends compute it from the positions alone. The friction cone on its displacement is that of Harwin and Melder, "Improved
haptic rendering for multi-finger manipulation using friction cone based god-objects", Eurohaptics 2002.

Damping along the normal adds D d(depth)/dt, with the depths of the last two ticks, and never pulls. In the first tick
after an update both ends take the rate at its sample: where the probe was then, they do not know alike.

The patch oscillates along its normal: s(t) = v sin(w t) / w + a (1 - cos(w t)) / w^2; for w = 0 it moves by
v t + a t^2 / 2.
"""

from abc import ABCMeta, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any, ClassVar

from weberlink.codec.predictors.contract import FitLimits, Model, ModelKind, ModelRecord
from weberlink.codec.sample import Sample, SampleGrid
from weberlink.geometry.vector import ZERO, Vector, dot, is_finite, norm, scale, subtract, unit
from weberlink.update import ModelParameters
from weberlink_predictors.contact import ContactEstimator
from weberlink_predictors.estimation import Candidate, CandidatePredictor, EncodeContext, History, Signal
from weberlink_predictors.parameters import Float, Uniform, components, pack, unpack, vector_of
from weberlink_predictors.trigonometry import cosine, sine

LEAST_CURVATURE = 0.5  # A smaller curvature is set to 0, which costs less run time [1/m]
LEAST_FRICTION = 0.03  # A smaller coefficient of friction is noise: the surface counts as frictionless
MOTION_S = 0.080  # Window over which velocity and acceleration are fitted [s]
MOTION_STEP_S = 0.002  # Time from one sample of the window that is used to the next [s]
LEAST_MOTION_S = 0.008  # In a window of this length or less, no motion is fitted [s]


@dataclass(slots=True)
class SurfacePatch(Model):
    normal: Vector  # Unit normal, out of the surface, at `point`
    point: Vector  # The god-object at the newest sample [m]
    tick: int  # Tick of the newest sample
    stiffness: float  # [N/m]
    curvature: float = 0.0  # [1/m]; positive convex, negative concave
    friction: float = 0.0  # Coefficient of friction: tangential over normal force at which the probe slides
    velocity: float = 0.0  # v along the normal [m/tick]
    acceleration: float = 0.0  # a along the normal [m/tick^2]
    frequency: float = 0.0  # w [rad/tick]
    damping: float = 0.0  # D along the normal [N per m/tick]
    rate: float = 0.0  # d(depth)/dt at the newest sample [m/tick]

    @property
    def memory(self) -> Any:
        """The initial god-object [m]; with damping also depth [m] and tick of the last position, here unknown; None
        with neither."""
        if self.damping > 0.0:
            return self.point, None, 0.0
        return self.point if self.friction > 0.0 else None

    def at(self, tick: float, position: Vector) -> Vector:
        """The force without friction and damping."""
        normal, height = self._normal_and_height(tick, position)
        if not height < 0.0:
            return ZERO
        push = -self.stiffness * height
        return (push * normal[0], push * normal[1], push * normal[2])

    def advance(self, tick: float, position: Vector, memory: Any) -> tuple[Vector, Any]:
        """The force with friction and damping [N], and the new memory."""
        if self.damping == 0.0:
            return self._rub(tick, position, memory)
        held, before, then = memory
        (x, y, z), held = self._rub(tick, position, held)
        (a, b, c), height = self._normal_and_height(tick, position)
        depth = max(0.0, -height)
        rate = self.rate if before is None else (depth - before) / max(1.0, tick - then)
        push = max(self.damping * rate, -self.stiffness * depth) if depth > 0.0 else 0.0
        return (x + push * a, y + push * b, z + push * c), (held, depth, tick)

    def _rub(self, tick: float, position: Vector, memory: Vector) -> tuple[Vector, Vector]:
        """The force with friction [N], and the new god-object [m]."""
        normal, height = self._normal_and_height(tick, position)
        if not height < 0.0:
            return ZERO, position if is_finite(position) else memory
        a, b, c = normal
        # (x, y, z): the god-object without friction; (u, v, w): from there to the one with friction.
        x, y, z = position[0] - height * a, position[1] - height * b, position[2] - height * c
        u, v, w = memory[0] - x, memory[1] - y, memory[2] - z
        out = u * a + v * b + w * c
        u, v, w = u - out * a, v - out * b, w - out * c
        length, longest = sqrt(u * u + v * v + w * w), -self.friction * height
        if length > longest:
            back = longest / length
            u, v, w = u * back, v * back, w * back
        push, pull = -self.stiffness * height, self.stiffness
        held = (x + u, y + v, z + w)
        return (push * a + pull * u, push * b + pull * v, push * c + pull * w), held if is_finite(held) else memory

    def surface(self) -> "SurfacePatch":
        return self

    def record(self) -> ModelRecord:
        if self.curvature == 0.0:
            return ModelRecord(ModelKind.PLANE, self.normal, -dot(self.normal, self.point), self.stiffness)
        radius = 1.0 / self.curvature
        centre = subtract(self.point, scale(self.normal, radius))
        return ModelRecord(ModelKind.SPHERE, centre, radius, self.stiffness)

    def _normal_and_height(self, tick: float, position: Vector) -> tuple[Vector, float]:
        """Unit normal at the surface point nearest to a position, and the height of the position over it [m]."""
        a, b, c = self.normal
        point, raised = self.point, self._raised(tick)
        x, y, z = position[0] - point[0], position[1] - point[1], position[2] - point[2]
        if self.curvature == 0.0:
            return self.normal, x * a + y * b + z * c - raised
        # From the centre of curvature.
        away = 1.0 / self.curvature - raised
        x, y, z = x + away * a, y + away * b, z + away * c
        length = sqrt(x * x + y * y + z * z)
        if not length > 0.0:
            return self.normal, 0.0
        outward = 1.0 / length if self.curvature > 0.0 else -1.0 / length
        height = length - 1.0 / self.curvature if self.curvature > 0.0 else -length - 1.0 / self.curvature
        return (x * outward, y * outward, z * outward), height

    def _raised(self, tick: float) -> float:
        """Displacement of the patch along its normal since the newest sample [m]."""
        velocity, acceleration, frequency = self.velocity, self.acceleration, self.frequency
        if velocity == 0.0 and acceleration == 0.0:
            return 0.0
        ahead = tick - self.tick
        if frequency == 0.0:
            return (velocity + 0.5 * acceleration * ahead) * ahead
        angle = frequency * ahead
        # 1 - cos x = 2 sin^2(x / 2): the difference would lose all digits in a slow motion.
        half = sine(0.5 * angle)
        return (velocity * sine(angle) + acceleration / frequency * 2.0 * half * half) / frequency


def patch(
    newest: Sample, normal: Vector, compliance: float, curvature: float, limits: FitLimits, **others: float
) -> SurfacePatch | None:
    """The patch through a sample, with a unit normal, a compliance [m/N] and a curvature [1/m]; None beyond limits."""
    if not limits.accepts_compliance(compliance):
        return None
    if curvature != 0.0 and not limits.accepts_radius(1.0 / curvature):
        return None
    force, place = newest.value, newest.position
    damped = others.get("damping", 0.0) * others.get("rate", 0.0)
    if damped != 0.0:
        force = subtract(force, scale(normal, damped))
    point = (place[0] + compliance * force[0], place[1] + compliance * force[1], place[2] + compliance * force[2])
    return SurfacePatch(normal, point, newest.tick, 1.0 / compliance, curvature, **others)


class SurfaceHypothesis(metaclass=ABCMeta):
    """A candidate that assumes one kind of surface."""

    def __init__(self, signal: Signal) -> None:
        self._contact = signal.estimator(ContactEstimator)
        self._limits = signal.limits

    @abstractmethod
    def model(self, context: EncodeContext) -> SurfacePatch | None: ...


class FrictionlessHypothesis(SurfaceHypothesis):
    """At rest, without friction: the normal is the direction of the force."""

    def model(self, context: EncodeContext) -> SurfacePatch | None:
        contact, newest = self._contact, context.newest
        compliance = contact.frictionless.compliance
        if contact.age == 0 or compliance == 0.0 or norm(newest.value) == 0.0:
            return None
        return patch(newest, unit(newest.value), compliance, _curved(contact.curvature.value), self._limits)


class FrictionalHypothesis(SurfaceHypothesis):
    """At rest, with friction."""

    def model(self, context: EncodeContext) -> SurfacePatch | None:
        contact, newest = self._contact, context.newest
        compliance, normal, friction = contact.frictional.compliance, contact.normal, contact.friction
        if contact.age == 0 or compliance == 0.0 or friction < LEAST_FRICTION or dot(normal, newest.value) <= 0.0:
            return None
        curvature = _curved(contact.frictional_curvature.value)
        return patch(newest, normal, compliance, curvature, self._limits, friction=friction)


class DampedHypothesis(SurfaceHypothesis):
    """At rest, with damping, with friction if there is any, and flat."""

    def model(self, context: EncodeContext) -> SurfacePatch | None:
        contact, newest, places = self._contact, context.newest, context.history.places
        compliance, damping = contact.damped.compliance, contact.damped.damping
        if min(contact.age, len(places)) < 2 or compliance == 0.0 or norm(newest.value) == 0.0:
            return None
        normal, friction = contact.normal, contact.friction
        if friction < LEAST_FRICTION:
            normal, friction = unit(newest.value), 0.0
        rate = dot(normal, subtract(places[-2], places[-1]))
        if dot(normal, newest.value) <= max(0.0, damping * rate):
            return None
        return patch(newest, normal, compliance, 0.0, self._limits, friction=friction, damping=damping, rate=rate)


class MovingHypothesis(SurfaceHypothesis):
    """Moving along its normal, without friction, and flat."""

    def __init__(self, signal: Signal) -> None:
        super().__init__(signal)
        self._window, self._step, self._least = (
            max(1, round(time / signal.grid.period)) for time in (MOTION_S, MOTION_STEP_S, LEAST_MOTION_S)
        )

    def model(self, context: EncodeContext) -> SurfacePatch | None:
        contact, newest = self._contact, context.newest
        compliance, frequency = contact.moving.compliance, contact.frequency.value
        if contact.age == 0 or compliance == 0.0 or norm(newest.value) == 0.0:
            return None
        normal, motion = unit(newest.value), {}
        window = min(self._window, contact.age - 1 - len(context.ahead.values), len(context.history) - 1)
        if window > self._least:
            motion = _motion(context.history, normal, compliance, frequency, range(window, 0, -self._step))
            motion["frequency"] = frequency
        return patch(newest, normal, compliance, 0.0, self._limits, **motion)


_HYPOTHESES = (FrictionlessHypothesis, FrictionalHypothesis, MovingHypothesis, DampedHypothesis)
_Formats = dict[str, Float | Uniform]


def _layout(normal: Uniform, frequency: Uniform, *, curved: bool) -> tuple[Uniform, _Formats, _Formats]:
    """The format of each component of the normal; those of the other parameters, and of a surface that damps."""
    fields: _Formats = {
        "stiffness": Float(1.0, 5, 7),
        "curvature": Float(1e-2, 5, 6, signed=True),
        "friction": Uniform(0.0, 2.0**-7, 8),
        "velocity": Float(1e-8, 5, 6, signed=True),
        "acceleration": Float(1e-12, 6, 5, signed=True),
        "frequency": frequency,
    }
    if not curved:
        del fields["curvature"], fields["friction"]
    # It is at rest: rate and damping have the bits of a motion.
    instead = {"velocity": ("rate", fields["velocity"]), "acceleration": ("damping", Float(1.0, 5, 7))}
    return normal, fields, dict(instead.get(name, (name, form)) for name, form in fields.items())


_LAYOUTS = {
    1: _layout(Uniform(-1.0, 1.0, 2), Uniform(0.0, 2.0**-13, 9), curved=False),
    2: _layout(Uniform(-1.0, 2.0**-7, 8), Uniform(0.0, 2.0**-11, 7), curved=True),
    3: _layout(Uniform(-1.0, 2.0**-9, 10), Uniform(0.0, 2.0**-16, 12), curved=True),
}
"""By the number of axes that are sent."""


class SurfacePredictor(CandidatePredictor):
    name: ClassVar[str] = "surface"
    geometric: ClassVar[bool] = True
    describes_contact: ClassVar[bool] = True

    def candidates(self, signal: Signal) -> Sequence[Candidate]:
        return [hypothesis(signal) for hypothesis in _HYPOTHESES]

    def packed(self, model: SurfacePatch, newest: Sample, grid: SampleGrid) -> ModelParameters:  # noqa: ARG002
        damps = model.damping > 0.0
        normal, *others = _LAYOUTS[grid.value.size]
        levels = [int(damps), *(normal.level(each) for each in components(model.normal, grid.value))]
        levels += [field.level(getattr(model, name)) for name, field in others[damps].items()]
        return ModelParameters(pack(levels, widths_of(grid)))

    def unpacked(self, data: bytes, newest: Sample, grid: SampleGrid, limits: FitLimits) -> SurfacePatch | None:
        each, *layouts = _LAYOUTS[grid.value.size]
        damps, *fields = unpack(data, widths_of(grid))
        others, size = layouts[damps], grid.value.size
        x, y, z = vector_of([each.number(field) for field in fields[:size]], grid.value)
        length = sqrt(x * x + y * y + z * z)
        if not length > 0.0:
            return None
        numbers = {name: others[name].number(level) for name, level in zip(others, fields[size:], strict=True)}
        normal = (x / length, y / length, z / length)
        return patch(newest, normal, 1.0 / numbers.pop("stiffness"), numbers.pop("curvature", 0.0), limits, **numbers)


def widths_of(grid: SampleGrid) -> tuple[int, ...]:
    """Bits of each field of a surface's parameters."""
    normal, others, _ = _LAYOUTS[grid.value.size]
    return (1, *(normal.width,) * grid.value.size, *(field.width for field in others.values()))


SURFACE = SurfacePredictor()


def _curved(curvature: float) -> float:
    return curvature if abs(curvature) > LEAST_CURVATURE else 0.0


def _motion(history: History, normal: Vector, compliance: float, frequency: float, backs: range) -> dict[str, float]:
    """Velocity and acceleration of the surface, by least squares over the contact points so many ticks back."""
    values, places = history.values, history.places
    a, b, c = normal
    here = dot(normal, places[-1]) + compliance * dot(normal, values[-1])
    xx = xz = zz = xq = zq = 0.0
    for back in backs:
        (u, v, w), (x, y, z) = values[-1 - back], places[-1 - back]
        q = a * (x + compliance * u) + b * (y + compliance * v) + c * (z + compliance * w) - here
        ahead = -float(back)
        first, second = ahead, 0.5 * ahead * ahead
        if frequency > 0.0:
            angle = frequency * ahead
            first, second = sine(angle) / frequency, (1.0 - cosine(angle)) / (frequency * frequency)
        xx += first * first
        xz += first * second
        zz += second * second
        xq += first * q
        zq += second * q
    determinant = xx * zz - xz * xz
    if not determinant > 0.0:
        return {}
    return {"velocity": (xq * zz - zq * xz) / determinant, "acceleration": (xx * zq - xz * xq) / determinant}
