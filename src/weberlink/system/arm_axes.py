"""The axes of a session in joint space: their names, and their places in the vectors of the telemetry."""

from typing import Any, NamedTuple

from weberlink.geometry.joints import MOST_JOINTS
from weberlink.telemetry.record import JOINTS

GRIPPER = JOINTS[-1]


class ArmAxes(NamedTuple):
    """The axes that a session uses: the joints in order, then the gripper where there is one.

    Args:
        names: by axis.
        places: column of each axis in the fields `joint_*` of a record, whose last column is the gripper's.
    """

    names: tuple[str, ...]
    places: tuple[int, ...]


def arm_axes(system: Any) -> ArmAxes | None:
    """The axes in the configuration that a daemon or a recording tells; None without an arm."""
    try:
        codec = system["codec"]
        names = tuple(map(str, codec["joints"]["names"]))
        gripper = codec.get("gripper") is not None
    except (KeyError, TypeError, AttributeError):
        return None
    if not 1 <= len(names) <= MOST_JOINTS:
        return None
    if not gripper:
        return ArmAxes(names, tuple(range(len(names))))
    return ArmAxes((*names, GRIPPER), (*range(len(names)), MOST_JOINTS))
