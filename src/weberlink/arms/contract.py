"""The contract of arms that are led and followed joint by joint: what a driver of either end offers.

A leader is an arm in the operator's hand, with motors that display torque or without. A follower is a robot under
position control of its joints. The axes are the joints in order and, where the arm has one, the gripper last.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from weberlink.geometry.joints import Joints


class ArmFault(RuntimeError):  # noqa: N818 - a fault of a device, not an error of the program
    """The arm cannot go on; the message says why. The loop ends the session, without torque on the operator's hand."""


@dataclass(frozen=True, slots=True)
class ArmSpec:
    """What an arm can do, known before it is opened. All tuples have one entry for each axis."""

    name: str  # of the driver
    joints: tuple[str, ...]  # names of 1 to 8 in order, without the gripper
    gripper: bool  # whether one more axis, the last, is one; its angle is that of its motor, 0 closed
    lower: Joints  # least angles [rad]
    upper: Joints  # largest angles [rad]
    torque_nm: Joints  # largest that a leader displays or a follower measures; 0 for an axis that does not
    stiffness_nm_rad: Joints
    """Of the stiffest wall that a leader displays at `rate_hz`, or of a follower's control; inf for an ideal one."""
    rate_hz: float  # of the bus
    calibrated: bool  # whether torques are in newton metres by a calibration; otherwise by the data sheet of the motor
    buttons: int = 0  # how many it has
    lag_s: float = 0.0  # nominal age of a reading
    torque_error_nm: float = 0.0  # uncertainty of a measured torque at rest
    # After this time the motors themselves let go when their host stops; None if they never do. 0 for a computed arm.
    watchdog_s: float | None = None
    note: str = ""  # what a person should know before a run

    @property
    def force_feedback(self) -> bool:
        """Whether an axis displays or measures a torque."""
        return any(torque > 0.0 for torque in self.torque_nm)

    @property
    def axes(self) -> int:
        """Number of axes, 1 to 9."""
        return len(self.joints) + self.gripper


class ArmReading(NamedTuple):
    """Measured at `at` [s]: angles [rad], and torques of the environment on the arm [N m], zeros on a leader.

    `ended` once a script or a recording is over; `buttons` has bit i set while button i is pressed. `sampled_at` is the
    time of the newest sample behind an interpolated reading [s]; None if it is `at`.
    """

    at: float
    angles: Joints
    torques: Joints
    ended: bool = False
    buttons: int = 0
    sampled_at: float | None = None


class Arm(Protocol):
    """A leader or a follower. `latest` and `command` never block; `open` and `close` end in bounded time.

    `spec` is readable before `open`. `trouble` and `guarded` are looked for as on a device
    (`weberlink.master.devices.contract.Device`), `stay` as on a robot (`weberlink.slave.robots.contract.Robot`).
    """

    @property
    def spec(self) -> ArmSpec: ...

    def open(self, now: float) -> None: ...

    def latest(self, now: float) -> ArmReading:
        """The newest reading; the same one for the same `now`. ArmFault if it is not open, or cannot go on."""
        ...

    def command(self, values: Joints, now: float) -> None:
        """For all axes, the torques to display on the hand [N m], of a leader, or the angles to go to [rad], of a
        follower; they hold until the next ones. No effect unless open.

        Compensation of the leader's own gravity and friction is the driver's, in addition. Raises ValueError if a value
        is not finite.
        """
        ...

    def close(self) -> None:
        """Leave the arm safe, a leader without torque; may be called at any time, any number of times."""
        ...
