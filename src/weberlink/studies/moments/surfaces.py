"""The surface of a fitted model and that of a scene, with the same two questions to both: height, and nearest point."""

from dataclasses import dataclass
from math import acos, degrees, inf, sqrt
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from weberlink.codec.predictors.model import ModelKind, ModelRecord
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import Vector, add, dot, norm, scale, subtract, unit
from weberlink.slave.scenes.scene import Facing, Scene

FLAT_PER_M = 1e-3
"""Smaller curvatures, below that of a radius of 1 km, count as flat."""
STEP_M = 1e-5
"""Distance of the two normals from which a curvature is computed."""
ITERATIONS = 30
FOUND_M = 1e-7
STEEPEST = 0.05
"""Least cosine between a normal of the scene and that of the frame."""
AXES: tuple[Vector, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

Array = NDArray[np.float64]


class SurfaceFrame(NamedTuple):
    """Right-handed frame at a surface: two directions along it, one out of it."""

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
        turned: Array = (points - np.array(self.origin)) @ axes.T
        return turned


@dataclass(frozen=True)
class SurfacePoint:
    """A smooth surface at one of its points.

    Args:
        point: on the surface [m].
        normal: unit vector out of the solid.
        stiffness_n_m: of the contact.
        curvatures_per_m: the two principal ones, the larger first; positive where convex.
    """

    point: Vector
    normal: Vector
    stiffness_n_m: float
    curvatures_per_m: tuple[float, float]

    @property
    def radius_m(self) -> float:
        """Of the best sphere, from the mean curvature; infinite where flat, negative where concave."""
        mean = 0.5 * sum(self.curvatures_per_m)
        return inf if abs(mean) < FLAT_PER_M else 1.0 / mean


class DrawnSurface(Protocol):
    def height(self, frame: SurfaceFrame, u: float, v: float, farthest: float) -> float:
        """Height over (u, v) of a frame [m]; NaN where there is none within `farthest`."""
        ...

    def nearest(self, near: Vector) -> SurfacePoint | None:
        """The surface where it is nearest to a point [m]; None without a surface."""
        ...


class FittedSurface:
    """The plane or sphere of a fitted model."""

    def __init__(self, record: ModelRecord) -> None:
        self.kind = record.kind
        self.stiffness = record.stiffness
        self._vector, self._size = record.surface, record.size

    @property
    def centre(self) -> Vector:
        """Of a sphere [m]."""
        return self._vector

    @property
    def radius(self) -> float:
        """Of a sphere [m], negative where concave; infinite for a plane."""
        return self._size if self.kind is ModelKind.SPHERE else inf

    def height(self, frame: SurfaceFrame, u: float, v: float, farthest: float = inf) -> float:  # noqa: ARG002
        base = frame.point(u, v)
        if self.kind is ModelKind.PLANE:
            steepness = dot(self._vector, frame.normal)
            return -(dot(self._vector, base) + self._size) / steepness if abs(steepness) > 1e-6 else float("nan")
        away = subtract(base, self.centre)
        middle = dot(away, frame.normal)
        square = middle * middle - dot(away, away) + self._size * self._size
        if square < 0.0:
            return float("nan")
        return sqrt(square) - middle if self._size > 0.0 else -sqrt(square) - middle

    def nearest(self, near: Vector) -> SurfacePoint:
        if self.kind is ModelKind.PLANE:
            height = dot(self._vector, near) + self._size
            point = subtract(near, scale(self._vector, height))
            return SurfacePoint(point, self._vector, self.stiffness, (0.0, 0.0))
        outward = unit(subtract(near, self.centre))
        point = add(self.centre, scale(outward, abs(self._size)))
        normal = outward if self._size > 0.0 else scale(outward, -1.0)
        return SurfacePoint(point, normal, self.stiffness, (1.0 / self._size, 1.0 / self._size))


class SceneSurface:
    """The surface of a scene of any shapes, measured on the scene itself."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene

    def height(self, frame: SurfaceFrame, u: float, v: float, farthest: float) -> float:
        height = 0.0
        for _ in range(ITERATIONS):
            face = self._face(frame.point(u, v, height))
            steepness = dot(face.normal, frame.normal) if face is not None else 0.0
            if face is None or steepness < STEEPEST or abs(height) > farthest:
                return float("nan")
            if abs(face.gap) < FOUND_M:
                return height
            height -= face.gap / steepness
        return float("nan")

    def nearest(self, near: Vector) -> SurfacePoint | None:
        face = self._face(near)
        for _ in range(ITERATIONS):
            if face is None or abs(face.gap) < FOUND_M:
                break
            near = subtract(near, scale(face.normal, face.gap))
            face = self._face(near)
        return None if face is None else SurfacePoint(near, face.normal, face.stiffness, self._curvatures(near, face))

    def _face(self, point: Vector) -> Facing | None:
        return min(self._scene.facing(point), key=lambda face: face.gap, default=None)

    def _curvatures(self, point: Vector, face: Facing) -> tuple[float, float]:
        """Eigenvalues of the change of the normal along the surface, by central differences."""
        first = unit(_cross(face.normal, _least_along(face.normal)))
        tangents = (first, _cross(face.normal, first))
        turns = []
        for tangent in tangents:
            ends = [self._normal(face, add(point, scale(tangent, sign * STEP_M))) for sign in (1.0, -1.0)]
            turns.append(scale(subtract(*ends), 0.5 / STEP_M))
        shape = np.array([[dot(tangent, turn) for turn in turns] for tangent in tangents])
        low, high = np.linalg.eigvalsh(0.5 * (shape + shape.T)).tolist()
        return high, low

    def _normal(self, face: Facing, point: Vector) -> Vector:
        """Of the same object beside `face`; of several planes the one with the most similar normal."""
        mine = [other for other in self._scene.facing(point) if other.owner == face.owner]
        return max(mine, key=lambda other: dot(other.normal, face.normal), default=face).normal


def frame_at(newest: Sample, towards: Vector) -> SurfaceFrame:
    """Frame at a sample with its normal along the force, and `along` as near to the direction `towards` as possible."""
    normal = unit(newest.value)
    for direction in (towards, _least_along(normal)):
        along = subtract(direction, scale(normal, dot(direction, normal)))
        if norm(along) > 1e-6:
            along = unit(along)
            return SurfaceFrame(newest.position, along, _cross(normal, along), normal)
    raise AssertionError("an axis far from the normal has a direction along the surface")


def angle_deg(one: Vector, other: Vector) -> float:
    """Between two unit vectors [deg]."""
    return degrees(acos(max(-1.0, min(1.0, dot(one, other)))))


def _least_along(normal: Vector) -> Vector:
    """The coordinate axis farthest from a direction."""
    return min(AXES, key=lambda axis: abs(dot(axis, normal)))


def _cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
