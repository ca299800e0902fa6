"""The paper's sphere: centre, radius and stiffness of a round wall from the two newest samples of the contact.

With u_i = f_i/|f_i| and c = 1/s, o + r u_i - c f_i = p_i holds for a convex wall (r > 0, the force points away from
the centre) and for a concave one (r < 0, it points to the centre): 6 equations for the 5 unknowns o, r, c. The centre
o appears in both equations in the same way. So the least-squares r and c are those of the difference,
r (u_1 - u_2) - c (f_1 - f_2) = p_1 - p_2, and o is the mean of the centres by the two samples. The difference is solved
by orthogonal projection; normal equations would square the condition number.

One fit finds both kinds of wall. The study `paper` measures what convex walls alone would send.
"""

from dataclasses import dataclass
from typing import ClassVar

from weberlink.codec.predictors.contract import FittedPredictor, same_contact
from weberlink.codec.predictors.model import FitLimits, Model, ModelKind, ModelRecord
from weberlink.codec.sample import Sample
from weberlink.compiled import mypyc_attr
from weberlink.geometry.vector import ZERO, Vector, add, dot, norm, scale, subtract, unit


@dataclass(slots=True)
class Sphere(Model):
    centre: Vector
    radius: float
    """r [m]: positive convex, negative concave."""
    stiffness: float
    """s [N/m]."""
    newest: Vector
    """The newest force [N]; also used at the centre, where the direction is undefined."""

    def at(self, tick: float, position: Vector) -> Vector:  # noqa: ARG002
        centre = self.centre
        x, y, z = position[0] - centre[0], position[1] - centre[1], position[2] - centre[2]
        length = norm((x, y, z))
        depth = self.radius - length if self.radius > 0.0 else length + self.radius
        if depth <= 0.0:
            return ZERO
        if length == 0.0:
            return self.newest
        outward = self.stiffness * depth / length if self.radius > 0.0 else -self.stiffness * depth / length
        return (outward * x, outward * y, outward * z)

    def surface(self) -> "Sphere":
        return self

    def record(self) -> ModelRecord:
        return ModelRecord(ModelKind.SPHERE, self.centre, self.radius, self.stiffness)


@mypyc_attr(allow_interpreted_subclasses=True)
class SpherePredictor(FittedPredictor):
    name: ClassVar[str] = "sphere"
    geometric: ClassVar[bool] = True
    describes_contact: ClassVar[bool] = True

    def fit(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Sphere | None:
        if previous is None or not same_contact(newest, previous):
            return None
        direction, earlier = unit(newest.value), unit(previous.value)
        solution = _solve(
            subtract(direction, earlier),
            subtract(previous.value, newest.value),
            subtract(newest.position, previous.position),
            limits.least_angle_sine,
        )
        if solution is None:
            return None
        radius, compliance = solution
        if not (limits.accepts_compliance(compliance) and limits.accepts_radius(radius)):
            return None
        centre = scale(
            add(
                _centre(newest, direction, radius, compliance),
                _centre(previous, earlier, radius, compliance),
            ),
            0.5,
        )
        sphere = Sphere(centre, radius, 1.0 / compliance, newest.value)
        return sphere if limits.accepts_fit(sphere, newest) else None

    def needs_previous(self, newest: Sample, previous: Sample) -> bool:
        return same_contact(newest, previous)


def _solve(a: Vector, b: Vector, y: Vector, least_sine: float) -> tuple[float, float] | None:
    """Least-squares r, c of a r + b c = y; None if the columns are (nearly) parallel or one is (nearly) 0."""
    a_norm, b_norm = norm(a), norm(b)
    if not (a_norm > least_sine and b_norm > 0.0):
        return None
    first = unit(a)
    along = dot(first, b)
    across = subtract(b, scale(first, along))
    across_norm = norm(across)
    if not across_norm > least_sine * b_norm:
        return None
    second = dot(unit(across), y) / across_norm
    return (dot(first, y) - along * second) / a_norm, second


def _centre(sample: Sample, direction: Vector, radius: float, compliance: float) -> Vector:
    return add(subtract(sample.position, scale(direction, radius)), scale(sample.value, compliance))


SPHERE = SpherePredictor()
