"""visualization_msgs/MarkerArray of a session: the solids of its scene, and hand and robot with their forces."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import cos, hypot, radians, sin, sqrt
from typing import Any

import numpy as np

from weberlink.config import MASTER
from weberlink.geometry.rotation import IDENTITY, Quaternion, product
from weberlink.geometry.vector import ZERO, Vector, add, norm, scale
from weberlink.telemetry.record import FORCE
from weberlink_figures.watching.ros import FIXED_FRAME
from weberlink_ros2.messages import encode_body, types

MARKERS = "visualization_msgs/msg/MarkerArray"
ARROW, CUBE, SPHERE, LINE_LIST, TRIANGLE_LIST = 0, 1, 2, 5, 11
DELETE_ALL = 3
SOLID, FLOOR, HAND, ROBOT = (0.55, 0.51, 0.44), (0.23, 0.28, 0.34), (0.35, 0.65, 1.0), (1.0, 0.60, 0.30)
HOLLOW = 0.3  # opacity of what one is inside of, of what is carved out, and of what it is carved out of
LEAST_REACH_M = 0.055
THIN_M = 5e-4  # of a drawn plane
MOST_CELLS = 40  # of a drawn height field in a row or column
LEAST_FORCE_N = 0.02
M_PER_N = 0.007  # length of an arrow in a view of `LEAST_REACH_M`

Shape = Mapping[str, Any]


def scene_markers(scene: Sequence[Shape], tool: Sequence[Vector]) -> bytes:
    """Body of a MarkerArray with all solids of `weberlink_figures.watching.scene.drawn`, and the robot's tool.

    Without a time, so that they hold until others take their place. The points of the tool are in its frame [m].
    """
    reach = reach_of(scene)
    markers = [marker for shape in scene for marker in _solid(shape, reach)]
    if tool:
        ends = [end for point in tool for end in ((0.0, 0.0, 0.0), point)]
        markers.append(_marker("robot", LINE_LIST, (0.002, 0.0, 0.0), ROBOT, points=ends))
    for number, marker in enumerate(markers):
        marker.ns, marker.id = "scene", number
    return _array(markers)


def body_markers(newest: Mapping[str, Any], reach: float, at_ns: int) -> bytes:
    """Body of a MarkerArray with hand and robot as balls, and the force that each feels as an arrow.

    `newest` has the newest record by side; `reach` is that of the view [m].
    """
    size, markers = reach / LEAST_REACH_M, list[Any]()
    for side, record in newest.items():
        place, force, colour = ("position", "output", HAND) if side == MASTER else ("output", "raw", ROBOT)
        (x, y, z), (u, v, w) = record[place][FORCE].tolist(), record[force][FORCE].tolist()
        at, along = (x, y, z), (u, v, w)
        if norm(along) < LEAST_FORCE_N:  # an arrow without length, since it has to take the place of the last one
            along = ZERO
        tip = add(at, scale(along, M_PER_N * size))
        shaft = (0.0012 * size, 0.0024 * size, min(0.0036 * size, 0.5 * M_PER_N * size * norm(along)))
        ball = _marker(FIXED_FRAME, SPHERE, (0.004 * size,) * 3, colour, at, at_ns=at_ns)
        arrow = _marker(FIXED_FRAME, ARROW, shaft, colour, points=[at, tip], at_ns=at_ns)
        ball.ns, arrow.ns, arrow.id = side, side, 1
        markers += ball, arrow
    return _array(markers)


def no_markers() -> bytes:
    """Body of a MarkerArray that removes all markers of its topic."""
    marker = _marker(FIXED_FRAME, SPHERE, (0.0, 0.0, 0.0), SOLID)
    marker.action = DELETE_ALL
    return _array([marker])


def reach_of(scene: Sequence[Shape]) -> float:
    """How far a view has to reach from the middle [m]; planes are as large as that."""
    far = 0.0
    for shape in scene:
        away = hypot(*(shape.get("center_m") or (0.0, 0.0))[:2])
        if shape["shape"] == "box":
            far = max(far, away + 0.5 * hypot(*shape["size_m"]))
        elif shape["shape"] == "sphere":
            far = max(far, away + min(shape["radius_m"], 0.05))
        elif shape.get("heights_m"):
            far = max(far, away + 0.5 * shape["spacing_m"] * max(len(shape["heights_m"]), len(shape["heights_m"][0])))
    return max(LEAST_REACH_M, 1.15 * far)


def _solid(shape: Shape, reach: float) -> Iterator[Any]:
    """A solid with what is carved out of it."""
    carved = [cut for cut in shape.get("carve") or () if cut["shape"] != "plane"]  # which has no end
    for each in (shape, *carved):
        opacity = HOLLOW if each is not shape or shape.get("carve") or shape.get("inside") else 1.0
        match each["shape"]:
            case "plane":
                x, y, z = each["normal"]
                normal = scale((x, y, z), 1.0 / norm((x, y, z)))
                depth = sum(n * p for n, p in zip(normal, each["point_m"], strict=True)) - 0.5 * THIN_M
                size = (2.0 * reach, 2.0 * reach, THIN_M)
                yield _marker(FIXED_FRAME, CUBE, size, FLOOR, scale(normal, depth), _toward(normal), opacity)
            case "sphere":
                size = (2.0 * each["radius_m"],) * 3
                yield _marker(FIXED_FRAME, SPHERE, size, SOLID, each["center_m"], opacity=opacity)
            case "box":
                turned = _from_angles(each.get("rotation_deg") or (0.0, 0.0, 0.0))
                yield _marker(FIXED_FRAME, CUBE, each["size_m"], SOLID, each["center_m"], turned, opacity)
            case "height_field" if each["heights_m"]:  # a file of another host has none
                one, corners = (1.0, 1.0, 1.0), list(_triangles(each["heights_m"], each["spacing_m"]))
                yield _marker(FIXED_FRAME, TRIANGLE_LIST, one, SOLID, each["center_m"], opacity=opacity, points=corners)


def _triangles(heights: Sequence[Sequence[float]], spacing: float) -> Iterator[Vector]:
    """Corners of the triangles of a height field around its centre [m], three of each; of a large one, fewer."""
    rows, columns = len(heights), len(heights[0])
    step = -(-max(rows, columns) // MOST_CELLS)

    def corner(j: int, i: int) -> Vector:
        j, i = min(j, rows - 1), min(i, columns - 1)
        return spacing * (i - (columns - 1) / 2), spacing * (j - (rows - 1) / 2), heights[j][i]

    for j in range(0, rows - 1, step):
        for i in range(0, columns - 1, step):
            for down, right in ((0, 0), (0, 1), (1, 0), (1, 0), (0, 1), (1, 1)):
                yield corner(j + down * step, i + right * step)


def _toward(normal: Vector) -> Quaternion:
    """The shortest turn of the z axis into a unit vector."""
    x, y, z = normal
    if z < -1.0 + 1e-9:
        return 0.0, 1.0, 0.0, 0.0
    w = sqrt(0.5 * (1.0 + z))
    return w, -0.5 * y / w, 0.5 * x / w, 0.0


def _from_angles(degrees: Sequence[float]) -> Quaternion:
    """R = Rz(yaw) Ry(pitch) Rx(roll) of (roll, pitch, yaw) [deg]."""
    (cr, sr), (cp, sp), (cy, sy) = ((cos(radians(a) / 2), sin(radians(a) / 2)) for a in degrees)
    return product(product((cy, 0.0, 0.0, sy), (cp, 0.0, sp, 0.0)), (cr, sr, 0.0, 0.0))


def _marker(
    frame: str,
    kind: int,
    size: Sequence[float],
    colour: Sequence[float],
    place: Sequence[float] = (0.0, 0.0, 0.0),
    turned: Quaternion = IDENTITY,
    opacity: float = 1.0,
    points: Iterable[Sequence[float]] = (),
    at_ns: int = 0,
) -> Any:
    made = types().types
    stamp = made["builtin_interfaces/msg/Time"](at_ns // 10**9, at_ns % 10**9)
    header = made["std_msgs/msg/Header"](stamp, frame)
    point, (w, x, y, z) = made["geometry_msgs/msg/Point"], turned
    pose = made["geometry_msgs/msg/Pose"](point(*map(float, place)), made["geometry_msgs/msg/Quaternion"](x, y, z, w))
    nothing = np.empty(0, np.uint8)
    return made["visualization_msgs/msg/Marker"](
        header=header, ns="", id=0, type=kind, action=0, pose=pose,
        scale=made["geometry_msgs/msg/Vector3"](*map(float, size)),
        color=made["std_msgs/msg/ColorRGBA"](*colour, opacity),
        lifetime=made["builtin_interfaces/msg/Duration"](0, 0), frame_locked=True,
        points=[point(*map(float, each)) for each in points], colors=[],
        texture_resource="", texture=made["sensor_msgs/msg/CompressedImage"](header, "", nothing), uv_coordinates=[],
        text="", mesh_resource="", mesh_file=made["visualization_msgs/msg/MeshFile"]("", nothing),
        mesh_use_embedded_materials=False,
    )  # fmt: skip


def _array(markers: Sequence[Any]) -> bytes:
    return encode_body(types().types[MARKERS](list(markers)), MARKERS)
