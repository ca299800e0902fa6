"""What every robot driver offers: the mirror of `weberlink.master.devices.contract`."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol, runtime_checkable

from pydantic import BaseModel

from weberlink.geometry.vector import ZERO, Vector
from weberlink.slave.scenes.scene import Scene

Quaternion = tuple[float, float, float, float]
"""(w, x, y, z)."""


class RobotFault(RuntimeError):  # noqa: N818 - a fault is what the operator meets, an error is ours
    """The robot cannot go on; says why. The loop stops sending force and leaves the session."""


@dataclass(frozen=True, slots=True)
class RobotSpec:
    """What a robot can do, known before it is opened.

    Args:
        name: As the driver calls it.
        axes: The axes that move, for example "xyz" or "z"; the others stay at 0.
        force_n: Largest force that it measures or stands [N].
        stiffness_n_m: Stiffness of its position control, infinite for an ideal one [N/m].
        workspace_m: Lower and upper corner of where it may be commanded to [m].
        rate_hz: Rate at which it takes commands [Hz].
        force_sensing: Whether `RobotReading.force` is measured; without it the reading holds zero.
        lag_s: How much older than `now` a reading is meant to be, for a robot that runs at a rate of its own [s].
        force_error: Uncertainty of the force, as a part in newtons and a share of the force; (0, 0) for an exact one.
        torque_n_m: Largest torque that it measures or stands [N m]; 0 where its tool has no orientation to command.
        watchdog_s: Time after which the robot itself removes the force or holds when its host stops [s]; None for
            never, and for a robot that is only computed.
        note: What a person should know before a run; empty if nothing.
    """

    name: str
    axes: str
    force_n: float
    stiffness_n_m: float
    workspace_m: tuple[Vector, Vector]
    rate_hz: float
    force_sensing: bool
    lag_s: float = 0.0
    force_error: tuple[float, float] = (0.0, 0.0)
    torque_n_m: float = 0.0
    watchdog_s: float | None = None
    note: str = ""


class RobotReading(NamedTuple):
    """Measured at `at` [s]: position of the tip [m], and the force of the environment on the robot [N].

    `torque` is that of the environment on the tool about the tip [N m], axes of the robot's frame as for the force.
    `sampled_at` is when the newest sample behind an interpolated reading was measured [s]; None where `at` says it.
    """

    at: float
    position: Vector
    force: Vector
    torque: Vector = ZERO
    sampled_at: float | None = None


class Robot(Protocol):
    """A robot under position control. `latest` and `command` never block, `open` and `close` not without end.

    `spec` is readable before `open`.

    `latest` raises `RobotFault` outside of `open` and `close`, and where the robot cannot go on. `command` has no
    effect outside of them, so that whoever makes the robot safe need not ask; it raises ValueError for a position
    that is not finite, which is a fault of our own. `close` may be called at any time, any number of times, and
    leaves the robot safe.
    """

    @property
    def spec(self) -> RobotSpec: ...

    def open(self, now: float) -> None: ...

    def command(self, position: Vector, now: float) -> None:
        """Where to go [m]; holds until the next command."""
        ...

    def latest(self, now: float) -> RobotReading:
        """The newest reading; asked twice with the same `now`, the same answer."""
        ...

    def close(self) -> None: ...


@runtime_checkable
class OrientedRobot(Robot, Protocol):
    """A robot whose tool can be turned about its tip. `spec.torque_n_m` is more than 0 where it is set up for that.

    `point` never blocks, has no effect outside of `open` and `close`, and raises ValueError for an orientation that is
    not finite or has no length. After `open` the tool is as it is at home until the first orientation.
    """

    def point(self, orientation: Quaternion, now: float) -> None:
        """The orientation to hold, from that at home, axes of the robot's frame; holds until the next."""
        ...


@runtime_checkable
class Explaining(Protocol):
    """A robot that knows more about samples that do not come than that they do not come."""

    @property
    def trouble(self) -> str | None:
        """What was wrong with the last attempt; None if nothing."""
        ...


class RobotDriver(Protocol):
    """A driver class as the table names it: its options, and how a robot is built from them.

    `scene` is what a simulated robot touches (None for a real one), `tick_period` the time between two ticks [s].
    """

    Options: ClassVar[type[BaseModel]]
    __call__: Callable[[Any, Scene | None, float], Robot]
