"""Records of earlier releases as those of this one.

Those had columns of their own for what turns (`rotation_`) and for arms (`joint_`: nine numbers, the gripper last;
`gripper_`), and the first ones lack some fields.
"""

from collections.abc import Sequence

import numpy as np

from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.record import FORCE, MOST_AXES, SECOND, TORQUE
from weberlink_figures.channel import GRIPPER
from weberlink_figures.message import Rows

ADDED = {"jitter_us": np.nan, "incoming_loss": np.nan, "outgoing_loss": np.nan}
ADDED |= {"peer_burst": 0.0, "energy": 0.0, "credit": 0.0}
"""Fields that the first releases lack, and what they hold then: those of the link "unknown", those of the account 0."""


def of_this_release(records: Rows, side: str, joints: Sequence[str]) -> Rows:
    """The records of a side with the fields of this release, but for those that no release lacked; as they are if they
    have no columns of an earlier one. `joints` are the axes of arms, the gripper last; none of a hand.
    """
    names = records.dtype.names or ()
    if "rotation_raw" not in names:
        return records
    former = {name: name.replace(SECOND, "gripper_" if joints else "rotation_") for name in DTYPE.names or ()}
    kept = [name for name, was in former.items() if was in names or name in ADDED or name.startswith(SECOND)]
    made = np.zeros(len(records), np.dtype([(name, DTYPE[name]) for name in kept]))
    if joints:
        prefix, others, axes = "joint_", {"coded": "raw"}, slice(0, len(joints))
        places = [MOST_AXES - 1 if name == GRIPPER else place for place, name in enumerate(joints)]
    else:  # where the hand was and the robot had to be is what was sent and commanded
        prefix, others, axes = (
            "rotation_",
            {"coded": "raw", "position": "raw" if side == "master" else "output"},
            TORQUE,
        )
        places = [0, 1, 2]
    for name in kept:
        values = records[former[name]] if former[name] in names else ADDED.get(name, 0.0)
        if DTYPE[name].shape != (MOST_AXES,):
            made[name] = values
        else:
            made[name][:, FORCE] = values
            was = f"{prefix}{others.get(name, name)}"
            made[name][:, axes] = records[was][:, places] if was in names else np.nan
    return made
