"""A fitted model as a surface, beside the scene that it was fitted to: patches to draw and parameters to compare.

Owns the geometry behind a drawing of a fit. It knows neither runs nor figures. Whatever is curved in a scene is
measured on the scene itself, so that any shape can be compared.
"""

from dataclasses import dataclass
from math import acos, degrees, inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.codec.predictors.plane import Plane
from weberlink.codec.predictors.sphere import Sphere
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import Vector, add, dot, norm, scale, subtract, unit
from weberlink.slave.scenes.scene import Facing, Scene

FLAT_PER_M = 1e-3
"""Less curvature, a radius of a kilometre, is flat."""
STEP_M = 1e-5
"""Between the normals from which a curvature is taken."""
ITERATIONS = 30
FOUND_M = 1e-7

Array = NDArray[np.float64]


class Frame(NamedTuple):
    """Right-handed: two directions along a surface, one out of it."""

    origin: Vector
    along: Vector
    across: Vector
    normal: Vector

    def point(self, u: float, v: float, height: float = 0.0) -> Vector:
        sideways = add(scale(self.along, u), scale(self.across, v))
        return add(add(self.origin, sideways), scale(self.normal, height))

    def coordinates(self, points: Array) -> Array:
        """Points, shape (n, 3) [m], as along, across and normal, shape (n, 3) [m]."""
        axes = np.array([self.along, self.across, self.normal])
        away: Array = points - np.array(self.origin)
        turned: Array = away @ axes.T
        return turned


@dataclass(frozen=True)
class Surface:
    """A smooth surface at one of its points.

    Args:
        point: on the surface [m].
        normal: out of the solid.
        stiffness_n_m: of the contact.
        curvatures_per_m: the two principal ones, the larger first; positive where the solid bulges.
    """

    point: Vector
    normal: Vector
    stiffness_n_m: float
    curvatures_per_m: tuple[float, float]

    @property
    def radii_m(self) -> tuple[float, float]:
        """Of `curvatures_per_m`; infinite where flat, negative where concave."""
        first, second = self.curvatures_per_m
        return _radius(first), _radius(second)


def frame_at(newest: Sample, towards: Vector) -> Frame:
    """Origin at a sample, normal along its force, `along` as near to the direction `towards` as can be."""
    normal = unit(newest.value)
    least = min(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), key=lambda axis: abs(dot(axis, normal)))
    for direction in (towards, least):
        along = subtract(direction, scale(normal, dot(direction, normal)))
        if norm(along) > 1e-6:
            along = unit(along)
            return Frame(newest.position, along, _cross(normal, along), normal)
    raise AssertionError("an axis far from the normal has a direction along the surface")


def fitted_height(model: Plane | Sphere, frame: Frame, u: float, v: float) -> float:
    """How far the fitted surface is along the normal of the frame over (u, v) [m]; NaN where it is not."""
    base = frame.point(u, v)
    if isinstance(model, Plane):
        steepness = dot(model.normal, frame.normal)
        return -(dot(model.normal, base) + model.offset) / steepness if abs(steepness) > 1e-6 else float("nan")
    away = subtract(base, model.centre)
    middle = dot(away, frame.normal)
    square = middle * middle - dot(away, away) + model.radius * model.radius
    if square < 0.0:
        return float("nan")
    return sqrt(square) - middle if model.radius > 0.0 else -sqrt(square) - middle


def scene_height(scene: Scene, frame: Frame, u: float, v: float, farthest: float) -> float:
    """The same of the scene, as found from the frame outward; NaN if it is not within `farthest` [m]."""
    height = 0.0
    for _ in range(ITERATIONS):
        face = _nearest(scene, frame.point(u, v, height))
        steepness = dot(face.normal, frame.normal) if face is not None else 0.0
        if face is None or steepness < 0.05 or abs(height) > farthest:
            return float("nan")
        if abs(face.gap) < FOUND_M:
            return height
        height -= face.gap / steepness
    return float("nan")


def scene_surface(scene: Scene, near: Vector) -> Surface | None:
    """The surface of a scene nearest to a point [m]; None in an empty scene."""
    face = _nearest(scene, near)
    for _ in range(ITERATIONS):
        if face is None or abs(face.gap) < FOUND_M:
            break
        near = subtract(near, scale(face.normal, face.gap))
        face = _nearest(scene, near)
    if face is None:
        return None
    return Surface(near, face.normal, face.stiffness, _curvatures(scene, near, face))


def fitted_surface(model: Plane | Sphere, near: Vector) -> Surface:
    """The surface of a model nearest to a point [m]."""
    if isinstance(model, Plane):
        height = dot(model.normal, near) + model.offset
        return Surface(subtract(near, scale(model.normal, height)), model.normal, model.stiffness, (0.0, 0.0))
    outward = unit(subtract(near, model.centre))
    point = add(model.centre, scale(outward, abs(model.radius)))
    normal = outward if model.radius > 0.0 else scale(outward, -1.0)
    return Surface(point, normal, model.stiffness, (1.0 / model.radius, 1.0 / model.radius))


def angle_deg(one: Vector, other: Vector) -> float:
    """Between two unit vectors [deg]."""
    return degrees(acos(max(-1.0, min(1.0, dot(one, other)))))


def _nearest(scene: Scene, point: Vector) -> Facing | None:
    return min(scene.facing(point), key=lambda face: face.gap, default=None)


def _curvatures(scene: Scene, point: Vector, face: Facing) -> tuple[float, float]:
    """Eigenvalues of the change of the normal along the surface, by central differences."""
    normal = face.normal
    least = min(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), key=lambda axis: abs(dot(axis, normal)))
    first = unit(_cross(normal, least))
    tangents = (first, _cross(normal, first))
    turns = []
    for tangent in tangents:
        ends = [
            _normal_of(scene, face, add(point, scale(tangent, sign * STEP_M)))
            for sign in (1.0, -1.0)
        ]  # fmt: skip
        turns.append(scale(subtract(*ends), 0.5 / STEP_M))
    shape = np.array([[dot(tangent, turn) for turn in turns] for tangent in tangents])
    low, high = np.linalg.eigvalsh(0.5 * (shape + shape.T)).tolist()
    return high, low


def _normal_of(scene: Scene, face: Facing, point: Vector) -> Vector:
    """Of the same object, a step aside; of its planes the one that is most alike."""
    mine = [other for other in scene.facing(point) if other.owner == face.owner]
    return max(mine, key=lambda other: dot(other.normal, face.normal), default=face).normal


def _cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _radius(curvature: float) -> float:
    return inf if abs(curvature) < FLAT_PER_M else 1.0 / curvature
