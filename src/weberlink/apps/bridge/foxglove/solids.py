"""The solids of a scene, and the tool of the robot, as things to draw."""

from collections.abc import Callable, Mapping, Sequence
from math import cos, hypot, radians, sin
from typing import Any

from foxglove.messages import (
    Color,
    CubePrimitive,
    LinePrimitive,
    LinePrimitiveLineType,
    Point3,
    Pose,
    SceneEntity,
    SceneEntityDeletion,
    SceneEntityDeletionType,
    SceneUpdate,
)

from weberlink.apps.bridge.foxglove.primitives import Z, ball, color, entity, moment, pose, toward, triangles, vector
from weberlink.geometry.rotation import Quaternion, product
from weberlink.geometry.rotation import vector as rotation_vector
from weberlink.geometry.vector import Vector, add, norm, scale

Shape = Mapping[str, Any]

SOLID, FLOOR, TOOL = "#8d8371", "#3a4757", "#ff9a4d"
HOLLOW = 0.3
"""Opacity of what one is inside of, of what is carved out, and of what it is carved out of."""
LEAST_REACH_M = 0.055
THIN_M = 5e-4
"""Thickness of a drawn plane."""
ROBOT_FRAME = "robot"


def reach_of(scene: Sequence[Shape]) -> float:
    """How far a view has to reach from the middle [m]; planes are as large as that."""
    far = 0.0
    for shape in scene:
        away = hypot(*(shape.get("center_m") or (0.0, 0.0))[:2])
        if shape["shape"] == "box":
            far = max(far, away + 0.5 * norm(shape["size_m"]))
        elif shape["shape"] == "sphere":
            far = max(far, away + min(shape["radius_m"], 0.05))
        elif shape.get("heights_m"):
            far = max(far, away + 0.5 * shape["spacing_m"] * max(len(shape["heights_m"]), len(shape["heights_m"][0])))
    return max(LEAST_REACH_M, 1.15 * far)


def scene_update(scene: Sequence[Shape], tool: Sequence[Vector], at_ns: int) -> SceneUpdate:
    """All solids of a scene as `weberlink.watching.hello.drawn` lists them, in place of whatever was drawn before.

    Args:
        scene: shapes.
        tool: points of the robot's tool in its frame [m]; none for a robot that is a point.
        at_ns: time on the wall clock [ns since 1970].
    """
    reach = reach_of(scene)
    entities = [_entity(f"solid {place}", shape, reach, at_ns) for place, shape in enumerate(scene)]
    if tool:
        entities.append(entity("tool", at_ns, {"lines": [_sticks(tool)]}, frame=ROBOT_FRAME))
    earlier = SceneEntityDeletion(timestamp=moment(at_ns), type=SceneEntityDeletionType.All)
    return SceneUpdate(deletions=[earlier], entities=entities)


def _entity(name: str, shape: Shape, reach: float, at_ns: int) -> SceneEntity:
    """A solid with what is carved out of it."""
    cuts = [cut for cut in shape.get("carve") or () if cut["shape"] != "plane"]  # which has no end
    parts: dict[str, list[Any]] = {}
    for drawn, opacity in (
        (shape, HOLLOW if shape.get("carve") or shape.get("inside") else 1.0),
        *((cut, HOLLOW) for cut in cuts),
    ):
        for kind, primitives in _DRAWN[drawn["shape"]](drawn, reach, opacity).items():
            parts.setdefault(kind, []).extend(primitives)
    return entity(name, at_ns, parts)


def _plane(shape: Shape, reach: float, opacity: float) -> dict[str, list[Any]]:
    normal = scale(shape["normal"], 1.0 / norm(shape["normal"]))
    middle = scale(normal, sum(n * p for n, p in zip(normal, shape["point_m"], strict=True)) - 0.5 * THIN_M)
    size = vector((2.0 * reach, 2.0 * reach, THIN_M))
    return {"cubes": [CubePrimitive(pose=pose(middle, toward(normal, Z)), size=size, color=color(FLOOR, opacity))]}


def _sphere(shape: Shape, _reach: float, opacity: float) -> dict[str, list[Any]]:
    return {"spheres": [ball(shape["center_m"], 2.0 * shape["radius_m"], color(SOLID, opacity))]}


def _box(shape: Shape, _reach: float, opacity: float) -> dict[str, list[Any]]:
    turned = rotation_vector(_from_angles(shape.get("rotation_deg") or (0.0, 0.0, 0.0)))
    place: Pose = pose(shape["center_m"], turned)
    return {"cubes": [CubePrimitive(pose=place, size=vector(shape["size_m"]), color=color(SOLID, opacity))]}


def _height_field(shape: Shape, _reach: float, opacity: float) -> dict[str, list[Any]]:
    heights, spacing = shape["heights_m"], shape["spacing_m"]
    if not heights:  # in a file of another host
        return {}
    rows, columns = len(heights), len(heights[0])
    corners = [
        add(shape["center_m"], (spacing * (i - (columns - 1) / 2), spacing * (j - (rows - 1) / 2), heights[j][i]))
        for j in range(rows)
        for i in range(columns)
    ]
    faces: list[int] = []
    for j in range(rows - 1):
        for first in range(j * columns, j * columns + columns - 1):
            above = first + columns
            faces += [first, first + 1, above, above, first + 1, above + 1]
    return {"triangles": [triangles(corners, faces, color(SOLID, opacity))]}


_DRAWN: dict[str, Callable[[Shape, float, float], dict[str, list[Any]]]] = {
    "plane": _plane,
    "sphere": _sphere,
    "box": _box,
    "height_field": _height_field,
}


def _from_angles(degrees: Sequence[float]) -> Quaternion:
    """R = Rz(yaw) Ry(pitch) Rx(roll) of (roll, pitch, yaw) [deg]."""
    (cr, sr), (cp, sp), (cy, sy) = ((cos(radians(a) / 2), sin(radians(a) / 2)) for a in degrees)
    return product(product((cy, 0.0, 0.0, sy), (cp, 0.0, sp, 0.0)), (cr, sr, 0.0, 0.0))


def _sticks(tool: Sequence[Vector]) -> LinePrimitive:
    """Lines from the middle of a tool to its points."""
    ends = [end for point in tool for end in ((0.0, 0.0, 0.0), point)]
    colored: Color = color(TOOL)
    points = [Point3(x=float(x), y=float(y), z=float(z)) for x, y, z in ends]
    return LinePrimitive(
        type=LinePrimitiveLineType.LineList, pose=pose((0.0, 0.0, 0.0)), thickness=0.002, points=points, color=colored
    )
