"""The paper's plane: a flat wall along the newest force, with offset and stiffness from two samples.

The normal is n = f_1/|f_1|. The offset d and c = 1/s solve n.p_i + d + |f_i| c = 0 for the two newest samples of the
contact. The height of p over the wall is h = n.p + d; the force is -s h n if h < 0, otherwise 0.

Other readings of the paper take n.f_2 for |f_2|, or its own normal n_i for each sample. The study `paper`
measures what they would send.
"""

from dataclasses import dataclass
from typing import ClassVar

from weberlink.codec.predictors.contract import FittedPredictor
from weberlink.codec.predictors.model import FitLimits, Model, ModelKind, ModelRecord
from weberlink.codec.sample import Sample
from weberlink.compiled import mypyc_attr
from weberlink.geometry.vector import ZERO, Vector, dot, norm, subtract


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


@mypyc_attr(allow_interpreted_subclasses=True)
class PlanePredictor(FittedPredictor):
    name: ClassVar[str] = "plane"
    geometric: ClassVar[bool] = True
    describes_contact: ClassVar[bool] = True

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

    def needs_previous(self, newest: Sample, previous: Sample) -> bool:
        return ZERO not in (newest.value, previous.value)


PLANE = PlanePredictor()
