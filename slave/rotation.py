"""The tool of the robot as a channel: it turns as the hand does, and the torque on it is sensed."""

from collections.abc import Callable
from math import inf
from typing import Any

from weberlink.codec import Encoder
from weberlink.codec.outgoing import OutgoingChannel
from weberlink.geometry.joints import Joints
from weberlink.geometry.rotation import IDENTITY, Quaternion, quaternion, toward, vector
from weberlink.geometry.vector import ZERO, Vector, norm
from weberlink.slave.guard import Follower
from weberlink.slave.robot_port import Unreached
from weberlink.slave.robots.contract import RobotReading

LARGEST = 1e9  # No measured torque is as large [N m]; a telemetry record has room for it


class ToolOrientation(Follower):
    """Turns the tool to the decoded orientation; speeds are angular [rad/s].

    `applied` is what it was last commanded, as a rotation vector near `commanded`, the decoded one [rad].
    """

    def __init__(self, *, speed: float, approach_speed: float, ramp: float) -> None:
        super().__init__(IDENTITY, 4, speed=speed, approach_speed=approach_speed, ramp=ramp, step_toward=toward)
        self.applied = self.commanded = ZERO

    def move(self, commanded: Vector | None, step: float) -> Quaternion:
        """Follow the decoded value for `step` more seconds, or hold where there is None; the orientation to command."""
        held: Any
        if commanded is None:
            held = self.hold(step)
        else:
            self.commanded, goal = commanded, quaternion(commanded)
            held = self.pursue(goal, step)
            self.applied = commanded if held == goal else vector(held, self.applied)
        orientation: Quaternion = held
        return orientation


class ToolTorque(OutgoingChannel):
    """The torque of the environment on the tool [N m], as far as it may be shown, at the commanded orientation."""

    def __init__(
        self,
        encoder: Encoder,
        shown: Callable[[Joints], Joints],
        orientation: ToolOrientation,
        unreached: Unreached | None = None,
    ) -> None:
        super().__init__(encoder, ZERO)
        self._shown, self._orientation, self._unreached = shown, orientation, unreached

    def complaint(self, reading: RobotReading) -> str | None:
        return None if norm(reading.torque) < LARGEST else f"reports the torque {reading.torque}"

    def take(self, reading: RobotReading) -> None:
        self.value = reading.torque

    def sample(self, tick: int) -> tuple[Vector, float]:
        self.sampled = shown = self._shown(self.value)
        place = self._orientation.applied
        return place if self._unreached is None else self._unreached.place(tick, shown, place), inf
