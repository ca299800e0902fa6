"""The interface of every robot driver."""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from weberlink.geometry.vector import ZERO, Vector


class RobotFault(RuntimeError):  # noqa: N818 - a fault of a device, not an error of the program
    """The robot cannot go on, with the reason. The loop stops sending force and leaves the session."""


@dataclass(frozen=True, slots=True)
class RobotSpec:
    """Properties of a robot, readable before it is opened."""

    name: str  # of the driver
    axes: str  # that move, for example "xyz" or "z"; the others stay at 0
    force_n: float  # largest force that it measures or withstands
    stiffness_n_m: float  # of its position control, infinite for an ideal one
    workspace_m: tuple[Vector, Vector]  # lower and upper corner for commands
    rate_hz: float  # at which it takes commands
    force_sensing: bool  # whether `RobotReading.force` is measured; otherwise it is zero
    lag_s: float = 0.0  # nominal age of a reading, for a robot that runs at its own rate
    force_error: tuple[float, float] = (0.0, 0.0)  # newtons, and a share of the force; (0, 0) for an exact one
    torque_n_m: float = 0.0  # largest that it measures or withstands; 0 if its tool cannot be turned
    watchdog_s: float | None = None  # after which it stops itself when its host does; None for never, or if computed
    note: str = ""  # what a person should know before a run


class RobotReading(NamedTuple):
    """Measured at `at` [s]: position of the tip [m], force [N] and torque about the tip [N m] of the environment on
    the robot, robot frame.

    `sampled_at` is the time of the newest sample behind an interpolated reading [s]; None if it is `at`.
    """

    at: float
    position: Vector
    force: Vector
    torque: Vector = ZERO
    sampled_at: float | None = None


class Robot(Protocol):
    """A robot under position control. `latest` and `command` never block; `open` and `close` end in bounded time.

    It may also have `trouble`, which is what was wrong with the last attempt where samples are missing, else None;
    `stay()`, where `close` may move it: called at an emergency stop or a failure, after which it moves no more; and a
    simulated one, called before `open` of a live loop, `publish_pose()`, to publish its pose until `close` for who
    draws its scene, and `measure_steps(stopwatch)`, to adapt its computation to the machine. One whose tool can be
    turned about its tip, set up for that if `spec.torque_n_m` is more than 0, has `point(orientation, now)`: turn to a
    quaternion, relative to that at home, robot frame; it holds until the next one, and `open` turns back. It never
    blocks, has no effect unless the robot is open, and raises ValueError for a quaternion that is not finite or has no
    length.
    """

    @property
    def spec(self) -> RobotSpec: ...

    def open(self, now: float) -> None: ...

    def command(self, position: Vector, now: float) -> None:
        """Go to a position [m]; it holds until the next command. No effect unless the robot is open. Raises ValueError
        if the position is not finite.
        """
        ...

    def latest(self, now: float) -> RobotReading:
        """The newest reading; the same for the same `now`. RobotFault if it is not open, or cannot go on."""
        ...

    def close(self) -> None:
        """Leave the robot safe; may be called at any time, any number of times."""
        ...
