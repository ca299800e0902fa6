"""How a follower under position control is left: it pushes no more, and stays where it is, or goes limp."""

from collections.abc import Callable
from enum import StrEnum
from typing import Final

from weberlink.geometry.joints import Joints


class OnClose(StrEnum):
    """How an arm is left; `hold` is the default, since without torque it drops."""

    HOLD = "hold"
    SINK = "sink"
    LIMP = "limp"


SETTLE_S: Final = 0.1
"""Time in which an arm comes to rest after its goals have moved [s]."""
SINK_RAD_S: Final = 0.3
"""Largest speed of the goals of an arm that sinks [rad/s]."""
LIES_S: Final = 0.5
"""An arm lies once it has not moved, with nothing to carry, for so long [s]: friction carries one that moves slowly."""
SINK_S: Final = 10.0
"""Longest time to sink [s]; an arm that does not lie by then is held."""
STEPS: Final = 4
FALLS: Final = 0.75
"""Share of its former push below which the push of an axis counts as falling."""
LEAST_RAD: Final = 0.003
"""Push of an axis that counts as none, as an error of its angle: two counts of a motor [rad]."""


def give_way(goals: Joints, here: Joints, go: Callable[[Joints], Joints]) -> Joints:
    """Move the goals to where the arm is, until it pushes on nothing.

    A contact follows an axis that gives way, and the push falls; then this axis gives way again. The weight of an arm
    without a model stays, however far it sinks: such an axis gives way once, and sinks by weight over stiffness.

    Args:
        goals: at first [rad].
        here: goals at which the arm would push on nothing where it is: its angles, raised by what carries its weight
            if there is a model of it [rad].
        go: sets goals, waits `SETTLE_S`, and gives the new `here`.

    Returns:
        The last goals.
    """
    pushes = tuple([goal - at for goal, at in zip(goals, here, strict=True)])
    gives = (True,) * len(goals)
    for _ in range(STEPS):
        goals = tuple([at if each else goal for goal, at, each in zip(goals, here, gives, strict=True)])
        here = go(goals)
        left = tuple([goal - at for goal, at in zip(goals, here, strict=True)])
        gives = tuple(
            [
                each and LEAST_RAD < abs(new) < FALLS * abs(old)
                for each, new, old in zip(gives, left, pushes, strict=True)
            ]
        )
        pushes = left
        if not any(gives):
            break
    return goals
