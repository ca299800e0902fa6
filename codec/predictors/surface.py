"""One patch of a surface, in all that a probe can feel of it: stiffness, curvature, Coulomb friction, and motion.

The sender works out the parameters from all of its samples (`codec.adaptive.surface`), and both ends compute the force
as a god-object does: the point where the surface holds the probe stays on the surface and pulls with the stiffness. It
sticks while the pull is inside the friction cone, and else slides after the probe. That it slides, and where to, both
ends know from the position alone. The cone on the displacement of that point is that of Harwin and Melder, "Improved
haptic rendering for multi-finger manipulation using friction cone based god-objects", Eurohaptics 2002.

Along its normal the patch moves as a swing about its place: s(t) = v sin(w t) / w + a (1 - cos(w t)) / w^2, which is
v t + a t^2 / 2 where w is 0.
"""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

from weberlink.codec.parameters import Float, Uniform
from weberlink.codec.predictors.contract import Parametric, Trust
from weberlink.codec.quantizer import Grids
from weberlink.codec.sample import Sample
from weberlink.geometry.sine import sine
from weberlink.geometry.vector import ZERO, Vector


class Surface(NamedTuple):
    normal: Vector
    """Unit vector out of the surface, where it held the probe at the newest sample."""
    point: Vector
    """That place [m]."""
    tick: int
    stiffness: float
    """[N/m]."""
    curvature: float = 0.0
    """[1/m]: positive convex, negative concave."""
    friction: float = 0.0
    """Coefficient: tangential over normal force at which the probe slides."""
    velocity: float = 0.0
    """v along the normal [m/tick]."""
    acceleration: float = 0.0
    """a [m/tick^2]."""
    pulse: float = 0.0
    """w [rad/tick]."""

    @property
    def memory(self) -> Vector | None:
        """Where the surface holds the probe to begin with [m]; None without friction, which needs to know."""
        return self.point if self.friction > 0.0 else None

    def at(self, tick: float, position: Vector) -> Vector:
        """The force without friction."""
        normal, height = self._under(tick, position)
        if not height < 0.0:
            return ZERO
        push = -self.stiffness * height
        return (push * normal[0], push * normal[1], push * normal[2])

    def along(self, tick: float, position: Vector, held: Vector) -> tuple[Vector, Vector]:
        """The force with friction, and where the surface holds the probe now.

        Args:
            tick: now.
            position: of the probe [m].
            held: where the surface held it [m]. The same call with what this one returns gives the same again, but for
                rounding.
        """
        normal, height = self._under(tick, position)
        if not height < 0.0:
            return ZERO, position
        a, b, c = normal
        # Where a surface without friction would hold it, and from there how far back it is held.
        x, y, z = position[0] - height * a, position[1] - height * b, position[2] - height * c
        u, v, w = held[0] - x, held[1] - y, held[2] - z
        out = u * a + v * b + w * c
        u, v, w = u - out * a, v - out * b, w - out * c
        length, longest = sqrt(u * u + v * v + w * w), -self.friction * height
        if length > longest:
            back = longest / length
            u, v, w = u * back, v * back, w * back
        push, pull = -self.stiffness * height, self.stiffness
        return (push * a + pull * u, push * b + pull * v, push * c + pull * w), (x + u, y + v, z + w)

    def wall(self) -> "Surface":
        """The patch where it was at the newest sample, without motion and friction, neither of which is elastic."""
        return self._replace(friction=0.0, velocity=0.0, acceleration=0.0, pulse=0.0)

    def _under(self, tick: float, position: Vector) -> tuple[Vector, float]:
        """Normal at the foot of a position, and its height over the surface [m]."""
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
        velocity, acceleration, pulse = self.velocity, self.acceleration, self.pulse
        if velocity == 0.0 and acceleration == 0.0:
            return 0.0
        ahead = tick - self.tick
        if pulse == 0.0:
            return (velocity + 0.5 * acceleration * ahead) * ahead
        angle = pulse * ahead
        # 1 - cos w t without the difference, which for a slow swing is all rounding.
        half = sine(0.5 * angle)
        return (velocity * sine(angle) + acceleration / pulse * 2.0 * half * half) / pulse


class _Layout(NamedTuple):
    """Fields of the parameters, by the axes that travel: 111, 79 and 47 bits are there."""

    normal: Uniform
    stiffness: Float
    curvature: Float | None
    friction: Uniform | None
    velocity: Float
    acceleration: Float
    pulse: Uniform

    @property
    def rest(self) -> list[tuple[str, Float | Uniform]]:
        """Those of one number each, and of which."""
        each = [(name, field) for name, field in zip(self._fields, self, strict=True) if name != "normal"]
        return [(name, field) for name, field in each if field is not None]


_STIFFNESS = Float(1.0, 5, 7)
_CURVATURE = Float(1e-2, 5, 6, signed=True)
_FRICTION = Uniform(0.0, 2.0**-7, 8)
_VELOCITY = Float(1e-8, 5, 6, signed=True)
_ACCELERATION = Float(1e-12, 6, 5, signed=True)
_LAYOUTS = {
    1: _Layout(Uniform(-1.0, 1.0, 2), _STIFFNESS, None, None, _VELOCITY, _ACCELERATION, Uniform(0.0, 2.0**-13, 9)),
    2: _Layout(
        Uniform(-1.0, 2.0**-7, 8), _STIFFNESS, _CURVATURE, _FRICTION, _VELOCITY, _ACCELERATION,
        Uniform(0.0, 2.0**-11, 7),
    ),
    3: _Layout(
        Uniform(-1.0, 2.0**-9, 10), _STIFFNESS, _CURVATURE, _FRICTION, _VELOCITY, _ACCELERATION,
        Uniform(0.0, 2.0**-16, 12),
    ),
}  # fmt: skip


def widths(grids: Grids) -> tuple[int, ...]:
    layout = _LAYOUTS[grids.value.size]
    return (layout.normal.width,) * grids.value.size + tuple(field.width for _, field in layout.rest)


def levels(model: Surface, newest: Sample, grids: Grids) -> list[int]:  # noqa: ARG001
    layout = _LAYOUTS[grids.value.size]
    normal = [layout.normal.level(each) for each in grids.value.components(model.normal)]
    return normal + [field.level(getattr(model, name)) for name, field in layout.rest]


def build(fields: Sequence[int], newest: Sample, grids: Grids, trust: Trust) -> Surface | None:
    """None where the bits are of no surface, or of one that is not trusted."""
    layout, size = _LAYOUTS[grids.value.size], grids.value.size
    x, y, z = grids.value.vector([layout.normal.number(field) for field in fields[:size]])
    length = sqrt(x * x + y * y + z * z)
    if not length > 0.0:
        return None
    numbers = {name: field.number(level) for (name, field), level in zip(layout.rest, fields[size:], strict=True)}
    normal = (x / length, y / length, z / length)
    return patch(newest, normal, 1.0 / numbers.pop("stiffness"), numbers.pop("curvature", 0.0), trust, **numbers)


def patch(
    newest: Sample, normal: Vector, compliance: float, curvature: float, trust: Trust, **motion: float
) -> Surface | None:
    """The patch that says a sample, or None where it is not trusted.

    Args:
        newest: the sample.
        normal: unit vector.
        compliance: 1/s [m/N].
        curvature: [1/m].
        trust: the range that is believed.
        motion: friction and motion, as the fields of a surface.
    """
    if not trust.believes_compliance(compliance):
        return None
    if curvature != 0.0 and not trust.believes_radius(1.0 / curvature):
        return None
    force, place = newest.value, newest.position
    point = (place[0] + compliance * force[0], place[1] + compliance * force[1], place[2] + compliance * force[2])
    return Surface(normal, point, newest.tick, 1.0 / compliance, curvature, **motion)


SURFACE = Parametric(widths, levels, build, geometric=True)
