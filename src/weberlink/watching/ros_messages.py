"""ROS 2 messages of poses, forces and frames, packed as arrays: what 3-D panels and ROS tools understand.

The size of a message is fixed by its frame names, so a whole channel is one numpy array (XCDR1, little endian: numbers
on multiples of their size, a string as its length with the final zero, and its bytes).
"""

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from weberlink.telemetry.message import Rows

FIXED_FRAME: Final = "weberlink"
"""The frame of the robot, in which all positions are."""

Array = NDArray[np.float64]

_RULE = "=" * 80
_TIME = "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
_HEADER = "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
_VECTOR = "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
_POINT = "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
_QUATERNION = "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
_POSE = "MSG: geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
_WRENCH = "MSG: geometry_msgs/Wrench\ngeometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n"
_TRANSFORM = "MSG: geometry_msgs/Transform\ngeometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"
_STAMPED = (
    "MSG: geometry_msgs/TransformStamped\nstd_msgs/Header header\nstring child_frame_id\n"
    "geometry_msgs/Transform transform\n"
)


def _definition(own: str, *others: str) -> str:
    return f"\n{_RULE}\n".join((own, *others))


SCHEMAS = {
    "geometry_msgs/msg/PoseStamped": _definition(
        "std_msgs/Header header\ngeometry_msgs/Pose pose\n", _HEADER, _TIME, _POSE, _POINT, _QUATERNION
    ),
    "geometry_msgs/msg/WrenchStamped": _definition(
        "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n", _HEADER, _TIME, _WRENCH, _VECTOR
    ),
    "tf2_msgs/msg/TFMessage": _definition(
        "geometry_msgs/TransformStamped[] transforms\n", _STAMPED, _HEADER, _TIME, _TRANSFORM, _VECTOR, _QUATERNION
    ),
    "sensor_msgs/msg/JointState": _definition(
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
        _HEADER,
        _TIME,
    ),
}
"""Definition of each message, with those that it consists of."""


@dataclass(frozen=True)
class Motion:
    """Places and orientations over time.

    Args:
        times_ns: on the wall clock, shape (n,).
        position_m: shape (n, 3).
        rotation_rad: rotation vectors, shape (n, 3); zero where there is no orientation.
    """

    times_ns: NDArray[np.uint64]
    position_m: Array
    rotation_rad: Array


class _Layout:
    """Fields of a message one after the other, each on its boundary."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.formats: list[str] = []
        self.offsets: list[int] = []
        self.end = 0

    def add(self, name: str, kind: str, count: int = 1, size: int = 0) -> None:
        """`kind` is a numpy type; `size` is its boundary if not its own."""
        width = np.dtype(kind).itemsize
        boundary = size or width
        offset = -(-self.end // boundary) * boundary
        self.names.append(name)
        self.formats.append(kind if count == 1 else f"{count}{kind}")
        self.offsets.append(offset)
        self.end = offset + count * width

    def add_text(self, name: str, text: str) -> None:
        self.add(f"{name}_length", "<u4")
        self.add(name, f"S{len(text.encode()) + 1}", size=1)

    def add_header(self, name: str, frame: str) -> None:
        self.add(f"{name}sec", "<i4")
        self.add(f"{name}nanosec", "<u4")
        self.add_text(f"{name}frame", frame)

    def rows_type(self) -> np.dtype[np.void]:
        layout = {"names": self.names, "formats": self.formats, "offsets": self.offsets, "itemsize": self.end}
        kind: np.dtype[np.void] = np.dtype(layout)  # type: ignore[call-overload]
        return kind


# Cached, since live messages are made some hundred times a second, a few at a time.
@cache
def _pose_type() -> np.dtype[np.void]:
    layout = _Layout()
    layout.add_header("", FIXED_FRAME)
    layout.add("position", "<f8", 3)
    layout.add("orientation", "<f8", 4)
    return layout.rows_type()


@cache
def _wrench_type(frame: str) -> np.dtype[np.void]:
    layout = _Layout()
    layout.add_header("", frame)
    layout.add("force", "<f8", 3)
    layout.add("torque", "<f8", 3)
    return layout.rows_type()


@cache
def _joint_type(names: tuple[str, ...]) -> np.dtype[np.void]:
    layout = _Layout()
    layout.add_header("", FIXED_FRAME)
    layout.add("names", "<u4")
    for place, name in enumerate(names):
        layout.add_text(f"name {place}", name)
    layout.add("angles", "<u4")
    layout.add("angle", "<f8", len(names))
    layout.add("velocities", "<u4")
    layout.add("torques", "<u4")
    layout.add("torque", "<f8", len(names))
    return layout.rows_type()


@cache
def _frames_type(children: tuple[str, ...]) -> np.dtype[np.void]:
    layout = _Layout()
    layout.add("count", "<u4")
    for child in children:
        layout.add_header(f"{child} ", FIXED_FRAME)
        layout.add_text(f"{child} child", child)
        layout.add(f"{child} translation", "<f8", 3)
        layout.add(f"{child} rotation", "<f8", 4)
    return layout.rows_type()


def pose_stamped(motion: Motion) -> Rows:
    """Bodies of geometry_msgs/PoseStamped in the fixed frame."""
    rows = np.zeros(len(motion.times_ns), _pose_type())
    _stamp(rows, "", FIXED_FRAME, motion.times_ns)
    rows["position"], rows["orientation"] = motion.position_m, quaternions(motion.rotation_rad)
    return rows


def wrench_stamped(times_ns: NDArray[np.uint64], frame: str, force_n: Array, torque_nm: Array) -> Rows:
    """Bodies of geometry_msgs/WrenchStamped that act at the origin of a frame, along its axes."""
    rows = np.zeros(len(times_ns), _wrench_type(frame))
    _stamp(rows, "", frame, times_ns)
    rows["force"], rows["torque"] = force_n, torque_nm
    return rows


def joint_state(times_ns: NDArray[np.uint64], names: tuple[str, ...], angles_rad: Array, torques_nm: Array) -> Rows:
    """Bodies of sensor_msgs/JointState without velocities; angles and torques have shape (n, number of names)."""
    rows = np.zeros(len(times_ns), _joint_type(names))
    _stamp(rows, "", FIXED_FRAME, times_ns)
    for place, name in enumerate(names):
        _say(rows, f"name {place}", name)
    rows["names"] = rows["angles"] = rows["torques"] = len(names)
    rows["angle"], rows["torque"] = angles_rad.reshape(rows["angle"].shape), torques_nm.reshape(rows["torque"].shape)
    return rows


def transforms(frames: dict[str, Motion]) -> Rows:
    """Bodies of tf2_msgs/TFMessage: each frame in the fixed one; all motions have the same times."""
    rows = np.zeros(len(next(iter(frames.values())).times_ns), _frames_type(tuple(frames)))
    rows["count"] = len(frames)
    for child, motion in frames.items():
        _stamp(rows, f"{child} ", FIXED_FRAME, motion.times_ns)
        _say(rows, f"{child} child", child)
        rows[f"{child} translation"] = motion.position_m
        rows[f"{child} rotation"] = quaternions(motion.rotation_rad)
    return rows


def quaternions(rotation_rad: Array) -> Array:
    """Unit quaternions (x, y, z, w), as ROS orders them, of rotation vectors of shape (n, 3)."""
    half = 0.5 * np.linalg.norm(rotation_rad, axis=1, keepdims=True)
    return np.hstack((0.5 * np.sinc(half / np.pi) * rotation_rad, np.cos(half)))


def _stamp(rows: Rows, prefix: str, frame: str, times_ns: NDArray[np.uint64]) -> None:
    rows[f"{prefix}sec"], rows[f"{prefix}nanosec"] = times_ns // 10**9, times_ns % 10**9
    _say(rows, f"{prefix}frame", frame)


def _say(rows: Rows, name: str, text: str) -> None:
    rows[f"{name}_length"], rows[name] = len(text.encode()) + 1, text.encode()
