"""The ROS topics of a session, live and of a recording: what each side shows of its ticks.

Poses of hand and robot, felt and measured forces, and the frames of all four; of a session of arms, the states of the
joints of leader and follower.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.config import MASTER
from weberlink.figures.channel import ArmLayout
from weberlink.telemetry.message import Rows
from weberlink.watching.ros_messages import SCHEMAS, Motion, joint_state, pose_stamped, transforms, wrench_stamped

_POSE, _WRENCH, _FRAMES, _STATE = SCHEMAS


class Shown(NamedTuple):
    """Messages of one topic.

    Args:
        topic: its name.
        type_name: of its messages.
        bodies: one for each tick, without encapsulation header.
    """

    topic: str
    type_name: str
    bodies: Rows


def topics(side: str, *, arm: bool) -> dict[str, str]:
    """Topics of a side and their types; `arm` for those of a session in joint space."""
    if arm:
        return {_topic(_arm(side)): _STATE}
    body, force = _cartesian(side)
    return {_topic(body): _POSE, _topic(force): _WRENCH, "/tf": _FRAMES}


def shown(side: str, ticks: Rows, times_ns: NDArray[np.uint64], arm: ArmLayout | None) -> Iterator[Shown]:
    """The messages of some ticks.

    Args:
        side: "master" or "slave".
        ticks: records of that side.
        times_ns: of each, on the wall clock [ns since 1970].
        arm: the axes of a session in joint space; None for one in Cartesian space.
    """
    if arm is not None:
        torques = ticks["joint_output"] if side == MASTER else ticks["joint_raw"]
        bodies = joint_state(times_ns, arm.axes, ticks["joint_position"][:, arm.places], torques[:, arm.places])
        yield Shown(_topic(_arm(side)), _STATE, bodies)
        return
    body, force_name = _cartesian(side)
    if side == MASTER:
        place, turn = ticks["position"], ticks["rotation_raw"]
        force, torque = ticks["output"], ticks["rotation_output"]
    else:
        place, turn = ticks["output"], ticks["rotation_output"]
        force, torque = ticks["raw"], ticks["rotation_raw"]
    motion = Motion(times_ns, place, np.asarray(turn, np.float64))
    yield Shown(_topic(body), _POSE, pose_stamped(motion))
    wrench = wrench_stamped(times_ns, force_name, force, np.asarray(torque, np.float64))
    yield Shown(_topic(force_name), _WRENCH, wrench)
    # A force is in the fixed frame's axes, so it has a frame of its own that does not turn.
    still = Motion(times_ns, place, np.zeros((len(ticks), 3)))
    yield Shown("/tf", _FRAMES, transforms({body: motion, force_name: still}))


def _topic(name: str) -> str:
    return f"/weberlink/{name}"


def _arm(side: str) -> str:
    return "leader" if side == MASTER else "follower"


def _cartesian(side: str) -> tuple[str, str]:
    """Names of the body and of the force of a side."""
    return ("hand", "felt") if side == MASTER else ("robot", "measured")
