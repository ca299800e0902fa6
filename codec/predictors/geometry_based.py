"""The paper's geometry-based predictors: an elastic wall, flat or round, from the two newest samples of the contact.

Other readings of the paper take n.f_2 for |f_2| of a plane, or its own normal for each sample. The study `paper`
measures what they would send, and what spheres would send that are convex only: one fit finds both kinds here.
"""

from dataclasses import dataclass
from typing import ClassVar

from weberlink.codec.predictors.contract import FitLimits, FittedPredictor, Model, ModelKind, ModelRecord
from weberlink.codec.sample import Sample
from weberlink.compiled import mypyc_attr
from weberlink.geometry.vector import ZERO, Vector, distance, dot, norm, subtract

# Sine of the angle below which two directions count as parallel: the forces of a sphere (a wire step of 1 mN turns a
# force of 1 N by 1e-3) and the columns of its equations.
PARALLEL = 1e-3
# Largest error of a sphere at its own newest sample, as a share of that force. If none passes through both samples, the
# least-squares sphere may push in the wrong direction.
MISFIT = 0.25


@mypyc_attr(allow_interpreted_subclasses=True)
class ContactPredictor(FittedPredictor):
    """Fits two samples of one contact, in which each has a force."""

    geometric: ClassVar[bool] = True
    describes_contact: ClassVar[bool] = True

    def needs_previous(self, newest: Sample, previous: Sample) -> bool:
        return ZERO not in (newest.value, previous.value)


@dataclass(slots=True)
class Plane(Model):
    normal: Vector  # Unit vector out of the wall
    offset: float  # d [m]
    stiffness: float  # s [N/m]

    def at(self, tick: float, position: Vector) -> Vector:  # noqa: ARG002
        normal = self.normal
        height = normal[0] * position[0] + normal[1] * position[1] + normal[2] * position[2] + self.offset
        if height >= 0.0:
            return ZERO
        force = -self.stiffness * height
        return (force * normal[0], force * normal[1], force * normal[2])

    def surface(self) -> "Plane":
        return self

    def record(self) -> ModelRecord:
        return ModelRecord(ModelKind.PLANE, self.normal, self.offset, self.stiffness)


class PlanePredictor(ContactPredictor):
    """The normal is n = f_1/|f_1|. The offset d and c = 1/s solve n.p_i + d + |f_i| c = 0 for the two samples. The
    height of p over the wall is h = n.p + d; the force is -s h n if h < 0, otherwise 0.
    """

    name: ClassVar[str] = "plane"

    def fit(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Plane | None:
        if previous is None or ZERO in (newest.value, previous.value):  # not of one contact
            return None
        (_, (x, y, z), place), before = newest, previous.position
        force = norm(newest.value)
        normal = (x / force, y / force, z / force)
        difference = force - norm(previous.value)
        if difference == 0.0:
            return None
        compliance = -dot(normal, subtract(place, before)) / difference
        if not limits.accepts_compliance(compliance):
            return None
        return Plane(normal, -dot(normal, place) - force * compliance, 1.0 / compliance)


PLANE = PlanePredictor()


@dataclass(slots=True)
class Sphere(Model):
    centre: Vector
    radius: float  # r [m]: positive convex, negative concave
    stiffness: float  # s [N/m]
    newest: Vector  # The newest force [N]; also used at the centre, where the direction is undefined

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


class SpherePredictor(ContactPredictor):
    """With u_i = f_i/|f_i| and c = 1/s, o + r u_i - c f_i = p_i holds for a convex wall (r > 0, the force points away
    from the centre) and for a concave one (r < 0, it points to the centre): 6 equations for the 5 unknowns o, r, c. The
    centre o appears in both equations in the same way. So the least-squares r and c are those of the difference,
    r (u_1 - u_2) - c (f_1 - f_2) = p_1 - p_2, and o is the mean of the centres by the two samples. The difference is
    solved by orthogonal projection; normal equations would square the condition number.
    """

    name: ClassVar[str] = "sphere"

    def fit(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Sphere | None:
        if previous is None or ZERO in (newest.value, previous.value):  # not of one contact
            return None
        (_, f, p), (_, g, q) = newest, previous
        size, earlier = norm(f), norm(g)
        u = (f[0] / size, f[1] / size, f[2] / size)
        v = (g[0] / earlier, g[1] / earlier, g[2] / earlier)
        # Least-squares r, c of a r + b c = y. A column that is (nearly) 0, or parallel to the other, tells nothing.
        a, b, y = subtract(u, v), subtract(g, f), subtract(p, q)
        a_norm, b_norm = norm(a), norm(b)
        if not (a_norm > PARALLEL and b_norm > 0.0):
            return None
        first = (a[0] / a_norm, a[1] / a_norm, a[2] / a_norm)
        along = dot(first, b)
        across = (b[0] - first[0] * along, b[1] - first[1] * along, b[2] - first[2] * along)
        across_norm = norm(across)
        if not across_norm > PARALLEL * b_norm:
            return None
        second = (across[0] / across_norm, across[1] / across_norm, across[2] / across_norm)
        c = dot(second, y) / across_norm
        r = (dot(first, y) - along * c) / a_norm
        if not (limits.accepts_compliance(c) and limits.accepts_radius(r)):
            return None
        centre = (
            ((p[0] - u[0] * r + f[0] * c) + (q[0] - v[0] * r + g[0] * c)) * 0.5,
            ((p[1] - u[1] * r + f[1] * c) + (q[1] - v[1] * r + g[1] * c)) * 0.5,
            ((p[2] - u[2] * r + f[2] * c) + (q[2] - v[2] * r + g[2] * c)) * 0.5,
        )
        sphere = Sphere(centre, r, 1.0 / c, f)
        return sphere if distance(sphere.at(newest.tick, p), f) <= MISFIT * size else None


SPHERE = SpherePredictor()
