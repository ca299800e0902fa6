"""The paper's plane: a flat wall with the normal of the newest force, its place and stiffness from two samples.

With n = f_1/|f_1|, d and c = 1/s solve n.p_i + d + |f_i| c = 0 over the two newest samples of the contact. The
height of p over the wall is h = n.p + d, and the force -s h n where h < 0.
"""

from typing import NamedTuple

from weberlink.codec.predictors.contact import same_contact
from weberlink.codec.predictors.contract import Predictor, Trust
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector, dot, norm, subtract, unit


class Plane(NamedTuple):
    normal: Vector
    """Unit vector out of the wall."""
    offset: float
    """d [m]."""
    stiffness: float
    """s [N/m]."""

    def at(self, tick: float, position: Vector) -> Vector:  # noqa: ARG002
        normal = self.normal
        height = normal[0] * position[0] + normal[1] * position[1] + normal[2] * position[2] + self.offset
        if height >= 0.0:
            return ZERO
        force = -self.stiffness * height
        return (force * normal[0], force * normal[1], force * normal[2])

    def wall(self) -> "Plane":
        return self


def fit(newest: Sample, previous: Sample | None, trust: Trust) -> Plane | None:
    if previous is None or not same_contact(newest, previous):
        return None
    force = norm(newest.value)
    normal = unit(newest.value)
    pressed = -dot(normal, subtract(newest.position, previous.position))
    difference = force - norm(previous.value)
    if difference == 0.0:
        return None
    compliance = pressed / difference
    if not trust.believes_compliance(compliance):
        return None
    return Plane(normal, -dot(normal, newest.position) - force * compliance, 1.0 / compliance)


PLANE = Predictor(fit, needs_previous=same_contact, geometric=True)
