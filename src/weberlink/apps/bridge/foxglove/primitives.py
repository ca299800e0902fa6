"""Values of this project as messages of Foxglove: vectors, poses, colours, arrows, balls and triangles."""

from collections.abc import Iterable, Mapping, Sequence
from math import acos, pi
from typing import Any

import numpy as np
from foxglove.messages import (
    ArrowPrimitive,
    Color,
    Duration,
    Point3,
    Pose,
    Quaternion,
    SceneEntity,
    SpherePrimitive,
    Timestamp,
    TriangleListPrimitive,
    Vector3,
)

from weberlink.geometry.rotation import quaternion
from weberlink.geometry.vector import ZERO, Vector, dot, norm, scale
from weberlink.telemetry.recording.ros import FIXED_FRAME

X: Vector = (1.0, 0.0, 0.0)
Z: Vector = (0.0, 0.0, 1.0)


def color(code: str, opacity: float = 1.0) -> Color:
    """A colour of the style sheet, such as `#58a6ff`."""
    red, green, blue = (int(code[place : place + 2], 16) / 255.0 for place in (1, 3, 5))
    return Color(r=red, g=green, b=blue, a=opacity)


def moment(at_ns: int) -> Timestamp:
    """A time of the wall clock [ns since 1970]."""
    return Timestamp(at_ns // 10**9, at_ns % 10**9)


def vector(of: Sequence[float]) -> Vector3:
    return Vector3(x=float(of[0]), y=float(of[1]), z=float(of[2]))


def orientation(rotation: Sequence[float]) -> Quaternion:
    """A rotation vector [rad]."""
    w, x, y, z = quaternion((float(rotation[0]), float(rotation[1]), float(rotation[2])))
    return Quaternion(x=x, y=y, z=z, w=w)


def pose(position: Sequence[float], rotation: Sequence[float] = ZERO) -> Pose:
    """A place [m] and a rotation vector [rad]."""
    return Pose(position=vector(position), orientation=orientation(rotation))


def toward(direction: Vector, of: Vector = X) -> Vector:
    """The rotation vector [rad] that turns the unit vector `of` into a direction; half a turn has any axis across."""
    length = norm(direction)
    axis, cosine = _cross(of, direction), dot(of, direction) / length
    sine = norm(axis)
    if sine > 1e-9 * length:
        return scale(axis, acos(max(-1.0, min(1.0, cosine))) / sine)
    return ZERO if cosine > 0.0 else scale(_cross(of, (of[1], of[2], of[0])), pi)


def ball(position: Sequence[float], diameter: float, colored: Color) -> SpherePrimitive:
    return SpherePrimitive(pose=pose(position), size=Vector3(x=diameter, y=diameter, z=diameter), color=colored)


def arrow(start: Sequence[float], along: Vector, width: float, colored: Color) -> ArrowPrimitive:
    """An arrow that is as long as a vector [m], longer than 0."""
    length = norm(along)
    head = min(3.0 * width, 0.5 * length)
    return ArrowPrimitive(
        pose=pose(start, toward(along)),
        shaft_length=length - head,
        shaft_diameter=width,
        head_length=head,
        head_diameter=2.0 * width,
        color=colored,
    )


def triangles(corners: Iterable[Sequence[float]], faces: list[int], colored: Color) -> TriangleListPrimitive:
    """Triangles between points [m]; three places of `corners` in `faces` make one."""
    points = [Point3(x=float(x), y=float(y), z=float(z)) for x, y, z in corners]
    return TriangleListPrimitive(pose=pose(ZERO), points=points, indices=faces, color=colored)


def entity(
    name: str, at_ns: int, parts: Mapping[str, Any], *, frame: str = FIXED_FRAME, lifetime_s: float = 0.0
) -> SceneEntity:
    """Something to draw, in place of an earlier one of its name.

    Args:
        name: of the entity; the topic has one with this name.
        at_ns: time on the wall clock [ns since 1970].
        parts: lists of primitives by kind.
        frame: in which it is.
        lifetime_s: how long it is drawn [s]; 0 for as long as nothing takes its place.
    """
    lifetime = Duration.from_secs(lifetime_s)
    return SceneEntity(timestamp=moment(at_ns), frame_id=frame, id=name, lifetime=lifetime, frame_locked=True, **parts)


def _cross(a: Vector, b: Vector) -> Vector:
    x, y, z = np.cross(a, b).tolist()
    return x, y, z
