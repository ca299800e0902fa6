"""The tool of the robot as a channel: it turns as the hand does, and the torque on it is sensed."""

from math import inf

from weberlink.geometry.rotation import IDENTITY, Quaternion, quaternion, toward, vector
from weberlink.geometry.vector import ZERO, Vector, norm
from weberlink.slave.robot_port import RobotPort
from weberlink.slave.robots.contract import OrientedRobot, RobotReading
from weberlink.slave.safety import Follower

LARGEST = 1e9
"""No measured torque is as large [N m]; a telemetry record has room for it."""


class ToolOrientation(Follower[Quaternion]):
    """Turns the tool to the decoded orientation, at a limited speed; a `weberlink.slave.robot_port.ChannelFollower`.

    Args:
        robot: that holds the tool.
        speed: largest angular speed while following [rad/s].
        approach_speed: angular speed of the approach after an engagement [rad/s].
        ramp: time in which the torque fades in [s].

    Attributes:
        applied: what the tool was last commanded, as a rotation vector near the decoded one [rad].
    """

    __slots__ = ("_robot", "applied")

    def __init__(self, robot: OrientedRobot, *, speed: float, approach_speed: float, ramp: float) -> None:
        super().__init__(IDENTITY, toward, speed=speed, approach_speed=approach_speed, ramp=ramp)
        self._robot = robot
        self.applied: Vector = ZERO

    def move(self, commanded: Vector | None, step: float, now: float) -> None:
        if commanded is None:
            held = self.hold(step)
        else:
            goal = quaternion(commanded)
            held = self.pursue(goal, step)
            self.applied = commanded if held == goal else vector(held, self.applied)
        self._robot.point(held, now)

    def halt(self, now: float) -> None:
        self._robot.point(self.hold(0.0), now)


class ToolTorque:
    """The torque of the environment on the tool [N m], as far as it may be shown, at the commanded orientation."""

    def __init__(self, port: RobotPort, orientation: ToolOrientation) -> None:
        self.value: Vector = ZERO
        self._port = port
        self._orientation = orientation

    def complaint(self, reading: RobotReading) -> str | None:
        return None if norm(reading.torque) < LARGEST else f"reports the torque {reading.torque}"

    def take(self, reading: RobotReading) -> None:
        self.value = reading.torque

    def sample(self) -> tuple[Vector, Vector, float]:
        return self._port.shown(self.value), self._orientation.applied, inf
