"""What a model knows of a surface, in numbers that telemetry can write down. Computes nothing."""

from typing import NamedTuple

from weberlink.codec.predictors import Model
from weberlink.codec.predictors.affine import Affine
from weberlink.codec.predictors.linear import Line
from weberlink.codec.predictors.plane import Plane
from weberlink.codec.predictors.sphere import Sphere
from weberlink.codec.predictors.surface import Surface
from weberlink.geometry.vector import Vector, dot, scale, subtract

NONE, LINE, PLANE, SPHERE = 0, 1, 2, 3
_UNKNOWN: Vector = (float("nan"),) * 3


class Fitted(NamedTuple):
    """A model in use.

    Args:
        kind: `NONE` (nothing received, or a held sample), `LINE` (in time, or in time and place), `PLANE` or `SPHERE`;
            a patch of surface is one of these, where it was at its newest sample.
        surface: unit normal of a plane, centre of a sphere [m]; NaN of anything else.
        size: d of a plane [m], radius of a sphere [m], negative where it is concave; NaN of anything else.
        stiffness: of plane and sphere [N/m]; NaN of anything else.
    """

    kind: int
    surface: Vector = _UNKNOWN
    size: float = float("nan")
    stiffness: float = float("nan")


UNFITTED = Fitted(NONE)
_EXTRAPOLATING = Fitted(LINE)


def fitted(model: Model | None) -> Fitted:
    """The numbers of a model; None is that of a decoder before its first update."""
    match model:
        case Plane():
            return Fitted(PLANE, model.normal, model.offset, model.stiffness)
        case Sphere():
            return Fitted(SPHERE, model.centre, model.radius, model.stiffness)
        case Surface():
            return _patch(model)
        case Line() | Affine():
            return _EXTRAPOLATING
        case _:
            return UNFITTED


def _patch(model: Surface) -> Fitted:
    if model.curvature == 0.0:
        return Fitted(PLANE, model.normal, -dot(model.normal, model.point), model.stiffness)
    radius = 1.0 / model.curvature
    return Fitted(SPHERE, subtract(model.point, scale(model.normal, radius)), radius, model.stiffness)
