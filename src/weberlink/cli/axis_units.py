"""Angles of an arm in the units of LeRobot, and the names of its features.

LeRobot gives a joint in degrees or as a share of its range, -100 to 100, and a gripper as 0 (closed) to 100.
"""

from collections.abc import Mapping
from math import degrees
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weberlink.cli.live_ends import GRIPPER, LiveEnd


class AxisUnits:
    """The axes of one end of a session as LeRobot names and scales them: `NAME.pos`, `NAME.torque`.

    A joint in degrees is 0 where it is 0 rad for the session. Shares are of the range in which the follower may be
    commanded, or of the leader's where the follower is on another host; they are clipped as LeRobot does. A Cartesian
    session has x, y and z in metres, and `NAME.force` [N].

    Args:
        end: of a session.
        use_degrees: joints in degrees, else as shares.

    Raises:
        ValueError: a range is needed and not known.
    """

    def __init__(self, end: LiveEnd, *, use_degrees: bool) -> None:
        self.names = end.names
        self.positions = [f"{name}.pos" for name in end.names]
        """Names of the features of motion."""
        effort = "torque" if end.is_arm else "force"
        self.efforts = [f"{name}.{effort}" for name in end.names]
        """Names of the features of torque [N m], or of force [N]."""
        count = len(end.names)
        self._factor, self._offset = np.ones(count), np.zeros(count)
        self._least, self._most = np.full(count, -np.inf), np.full(count, np.inf)
        if not end.is_arm:
            return
        lower, upper = _range(end)
        for i, name in enumerate(end.names):
            if name == GRIPPER and end.has_gripper:
                self._share(i, lower, upper, 0.0)
            elif use_degrees:
                self._factor[i] = degrees(1.0)
            else:
                self._share(i, lower, upper, -100.0)

    def _share(self, i: int, lower: NDArray[np.float64], upper: NDArray[np.float64], least: float) -> None:
        if not upper[i] > lower[i]:
            raise ValueError(f"the session does not tell the range of {self.names[i]}; use the same release")
        self._least[i], self._most[i] = least, 100.0
        self._factor[i] = (100.0 - least) / (upper[i] - lower[i])
        self._offset[i] = least - self._factor[i] * lower[i]

    def features(self, values: NDArray[np.float64]) -> dict[str, float]:
        """Features of angles [rad], or of positions [m]."""
        scaled = np.clip(values * self._factor + self._offset, self._least, self._most)
        return dict(zip(self.positions, scaled.tolist(), strict=True))

    def values(self, action: Mapping[str, Any]) -> tuple[float, ...]:
        """Angles [rad] or positions [m] of an action.

        Raises:
            ValueError: a feature is missing.
        """
        missing = [name for name in self.positions if name not in action]
        if missing:
            raise ValueError(f"the action lacks {', '.join(missing)}; it has {', '.join(action)}")
        given = np.clip([float(action[name]) for name in self.positions], self._least, self._most)
        return tuple(((given - self._offset) / self._factor).tolist())

    def window_names(self, ticks: int) -> list[str]:
        """Names of the features of a window of torques, tick by tick, the oldest first."""
        return [f"{name}.{tick}" for tick in range(ticks) for name in self.efforts]


def _range(end: LiveEnd) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least and largest angles of all axes [rad]; NaN where they are not known."""
    count = len(end.names)

    def each(key: str) -> NDArray[np.float64]:
        values = end.description_of_arm.get(key, [])
        return np.asarray(values, np.float64) if len(values) == count else np.full(count, np.nan)

    return each("lower_rad"), each("upper_rad")
