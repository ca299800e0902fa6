"""The ROS topics of a session, live and of a recording: what each side shows of its ticks, packed as arrays.

Poses of hand and robot, felt and measured forces, and the frames of all four; of a session of arms, the states of the
joints of leader and follower. The size of a message is fixed by its names, so a whole channel is one numpy array.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.config import MASTER
from weberlink.telemetry.record import FORCE, TORQUE
from weberlink_figures.message import CODES, Rows, aligned, fields_in

FIXED_FRAME: Final = "weberlink"  # the frame of the robot, in which all positions are

Array = NDArray[np.float64]

DEFINITIONS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"
    ),
}
MESSAGES = {
    "geometry_msgs/msg/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
    "geometry_msgs/msg/WrenchStamped": "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n",
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "sensor_msgs/msg/JointState": (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    ),
}
_POSE, _WRENCH, _FRAMES, _STATE = MESSAGES
SEPARATOR = "=" * 80  # between a definition and those that it consists of


def _schema(text: str) -> str:
    """A definition with those that it consists of."""
    found: dict[str, str] = {}

    def add(part: str) -> None:
        for kind, _ in fields_in(part):
            name = kind.removesuffix("[]")
            if name in DEFINITIONS and name not in found:
                found[name] = f"MSG: {name}\n{DEFINITIONS[name]}"
                add(DEFINITIONS[name])

    add(text)
    return f"\n{SEPARATOR}\n".join((text, *found.values()))


SCHEMAS = {name: _schema(text) for name, text in MESSAGES.items()}
"""Definition of each message, with those that it consists of."""


def bodies(type_name: str, value: Mapping[str, Any], count: int) -> Rows:
    """Bodies of messages, one after the other, without encapsulation header (plain CDR, little endian).

    Args:
        type_name: one of `SCHEMAS`.
        value: of its fields by name: numbers of shape (count,); texts, which are the same in all messages; for a list
            its parts; for a part with fields the same again, or a matrix whose columns are their values.
        count: of messages.
    """
    columns: list[tuple[str, int, Any]] = []  # format, boundary, and value

    def add(kind: str, value: Any) -> None:
        if kind.endswith("[]"):
            columns.append((CODES["uint32"], 4, len(value)))
            for part in value:
                add(kind.removesuffix("[]"), part)
        elif kind == "string":
            text = value.encode() + b"\0"
            columns.extend(((CODES["uint32"], 4, len(text)), (f"S{len(text)}", 1, text)))
        elif kind in CODES:
            columns.append((CODES[kind], np.dtype(CODES[kind]).itemsize, value))
        else:
            for index, (inner, name) in enumerate(fields_in(DEFINITIONS[kind])):
                add(inner, value[:, index] if isinstance(value, np.ndarray) else value[name])

    for kind, name in fields_in(MESSAGES[type_name]):
        add(kind, value[name])
    rows = np.zeros(count, aligned(tuple((str(place), *column[:2]) for place, column in enumerate(columns))))
    for place, (_, _, part) in enumerate(columns):
        rows[str(place)] = part
    return rows


def quaternions(rotation_rad: Array) -> Array:
    """Unit quaternions (x, y, z, w), as ROS orders them, of rotation vectors of shape (n, 3)."""
    half = 0.5 * np.linalg.norm(rotation_rad, axis=1, keepdims=True)
    return np.hstack((0.5 * np.sinc(half / np.pi) * rotation_rad, np.cos(half)))


class Shown(NamedTuple):
    topic: str
    type_name: str
    bodies: Rows  # one for each tick, without encapsulation header


def topics(side: str, *, arm: bool) -> dict[str, str]:
    """Topics of a side and their types; `arm` for those of a session in joint space."""
    body, force = _names(side, arm=arm)
    return {_topic(body): _STATE} if arm else {_topic(body): _POSE, _topic(force): _WRENCH, "/tf": _FRAMES}


def shown(side: str, ticks: Rows, times_ns: NDArray[np.uint64], joints: Sequence[str]) -> Iterator[Shown]:
    """The messages of some ticks.

    Args:
        times_ns: of each, on the wall clock [ns since 1970].
        joints: names of the axes of a session in joint space; none for one in Cartesian space.
    """
    body, force_name = _names(side, arm=bool(joints))
    place, force = ("position", "output") if side == MASTER else ("output", "raw")
    count, stamp = len(ticks), {"sec": times_ns // 10**9, "nanosec": times_ns % 10**9}
    header = {"stamp": stamp, "frame_id": FIXED_FRAME}
    if joints:
        angles, torques = (ticks[name].T[: len(joints)] for name in ("position", force))
        state = {"header": header, "name": joints, "position": angles, "velocity": (), "effort": torques}
        yield Shown(_topic(body), _STATE, bodies(_STATE, state, count))
        return
    position, turned = ticks[place][:, FORCE], quaternions(ticks[place][:, TORQUE])
    pose = {"position": position, "orientation": turned}
    yield Shown(_topic(body), _POSE, bodies(_POSE, {"header": header, "pose": pose}, count))
    wrench = {"force": ticks[force][:, FORCE], "torque": ticks[force][:, TORQUE]}
    of_force = {"stamp": stamp, "frame_id": force_name}
    yield Shown(_topic(force_name), _WRENCH, bodies(_WRENCH, {"header": of_force, "wrench": wrench}, count))
    # A force is in the fixed frame's axes, so it has a frame of its own that does not turn.
    still = quaternions(np.zeros((count, 3)))
    frames = [
        {"header": header, "child_frame_id": child, "transform": {"translation": position, "rotation": rotation}}
        for child, rotation in ((body, turned), (force_name, still))
    ]
    yield Shown("/tf", _FRAMES, bodies(_FRAMES, {"transforms": frames}, count))


def _topic(name: str) -> str:
    return f"/weberlink/{name}"


def _names(side: str, *, arm: bool) -> tuple[str, str]:
    """Of the body of a side, and of its force; an arm has the first alone."""
    if arm:
        return ("leader" if side == MASTER else "follower"), ""
    return ("hand", "felt") if side == MASTER else ("robot", "measured")
