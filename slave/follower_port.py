"""The teleoperator's end of the link with an arm: it follows the leader joint by joint, and its torques are sensed."""

from collections.abc import Sequence
from contextlib import suppress
from typing import ClassVar, Final

from weberlink.arms.contract import ArmFault, ArmReading, FollowerArm
from weberlink.arms.sensor import AxesSensor, sensors
from weberlink.control.ends import Control
from weberlink.geometry.joints import Joints, is_finite
from weberlink.slave.joint_safety import JointGuard, JointPressLimit
from weberlink.telemetry.record import RELEASED
from weberlink.telemetry.row import Row, placed


class FollowerPort:
    """A follower arm behind its guard; a `weberlink.session.port.Port`.

    Vectors have one entry for each axis: the joints in order and, where there is one, the gripper last.

    Args:
        arm: not yet open.
        lower: least angles that may be commanded [rad].
        upper: largest ones [rad].
        speed: largest speed of an axis while following [rad/s].
        approach_speed: the same of the approach after an engagement [rad/s].
        ramp: time in which the torques fade in and out [s].
        press: largest torque with which an axis presses on what it touches [N m]; without effect on one that measures
            no torque.
        trip: torque of the environment above which the arm stops following and backs off [N m].
        by_button: whether the operator leads only while holding a button; for telemetry.

    Attributes:
        joints: the sensor of the channel of the joints' torques.
        gripper: that of the gripper; None without one.
        angles: as measured [rad].
        angle_range: least and largest angles that may be commanded [rad].
        torques: of the environment, as measured [N m].
        shown: the part of them that the operator may feel [N m].
        applied: the commanded angles [rad].

    Raises:
        ValueError: the limits do not fit the arm, or each other.
    """

    kind: Final = "robot"
    leads: Final = False
    fault: ClassVar[type[ArmFault]] = ArmFault
    enabled: Final = True
    at_rest: Final = True
    unfounded: Final = False
    ended: Final = False
    controls: Final[tuple[Control, ...]] = (Control(),)

    def __init__(
        self,
        *,
        arm: FollowerArm,
        lower: Joints,
        upper: Joints,
        speed: float,
        approach_speed: float,
        ramp: float,
        press: Joints,
        trip: Joints,
        by_button: bool = False,
    ) -> None:
        spec = arm.spec
        if not len(lower) == len(upper) == len(press) == len(trip) == spec.axes:
            raise ValueError(f"{spec.name} has {spec.axes} axes; each limit must have as many")
        self.arm, self.name, self._by_button = arm, spec.name, by_button
        self._sensors = sensors("torques", len(spec.joints), spec.axes)
        self.joints: AxesSensor = self._sensors[0]
        self.gripper: AxesSensor | None = self._sensors[1] if spec.gripper else None
        self._guard = JointGuard(
            lower=lower, upper=upper, trip=trip, speed=speed, approach_speed=approach_speed, ramp=ramp
        )
        self._press_limit = JointPressLimit(press, spec.stiffness_nm_rad, spec.torque_error_nm)
        self.angle_range = lower, upper
        self._is_overloaded = False
        self.contact_ticks = 0
        """Ticks in which the press limit held an axis back."""
        self.angles: Joints = (0.0,) * spec.axes
        self.torques = self.shown = self.applied = self.angles
        self.latest = arm.latest  # bound here: it is called in every tick

    @property
    def trouble(self) -> str | None:
        return getattr(self.arm, "trouble", None)

    @property
    def tripped(self) -> bool:
        return self._guard.tripped

    def open(self, now: float) -> None:
        self.arm.open(now)
        reading = self.arm.latest(now)
        problem = self.joints.complaint(reading)
        if problem is not None:
            self.arm.close()
            raise ArmFault(f"{self.name} {problem}")
        self.angles = self.applied = reading.angles
        self._guard.place(self.applied)

    def close(self) -> None:
        self.arm.close()

    def accept(self, reading: ArmReading) -> bool:
        self.angles, self.torques = reading.angles, reading.torques
        self._is_overloaded = self._guard.is_overloaded(self.torques)
        trips = self._is_overloaded and not self._guard.tripped
        if trips:
            self._guard.trip(self.torques, self.angles)
        return trips

    def settle(self, now: float) -> None:
        """Hold the arm where it is commanded, or nearer to where it is now if it would press too much."""
        with suppress(ArmFault):  # the side meets it in this very tick, as it does a reading that is not finite
            reading = self.arm.latest(now)
            if self.joints.complaint(reading) is None:
                self.angles, self.torques = reading.angles, reading.torques
                self._guard.place(self._press_limit.near(self.applied, self.angles))

    def reset(self) -> None:
        self._guard.reset()

    def restart(self) -> None: ...

    def release(self, *, retreat: bool) -> None:  # noqa: ARG002 - holding is what is safe in any posture
        self._guard.release()

    def account(self, elapsed: float, tick: float, *, encodes: bool) -> int:  # noqa: ARG002
        share, torques = self._guard.share, self.torques
        self.shown = torques if share == 1.0 else tuple([share * torque for torque in torques])
        for sensor in self._sensors:
            sensor.keep(self.shown)
        return 0

    def actuate(
        self,
        values: Sequence[Joints | None],
        now: float,
        elapsed: float,  # noqa: ARG002
        step: float,
        *,
        engaged: bool,
    ) -> None:
        wanted = self._wanted(values) if engaged and not self._is_overloaded else None
        if wanted is None:
            self.applied = self._guard.hold(step)
            self._press_limit.forget()
        else:
            goal = self._press_limit.bounded(wanted, self.applied, self.angles, self.torques, step)
            self.contact_ticks += goal is not wanted
            self.applied = self._guard.follow(goal, step)
        self.arm.follow(self.applied, now)

    def _wanted(self, values: Sequence[Joints | None]) -> Joints | None:
        """The angles of all axes that the leader commands [rad]; None unless all were decoded."""
        commanded: Joints = ()
        for value in values:
            if value is None or not is_finite(value):
                return None
            commanded += value
        return commanded + self.applied[len(commanded) :]  # a gripper that the session does not lead

    def report(self, row: Row, *, is_led: bool) -> None:
        joints, guard = len(self.joints.value), self._guard
        row.joint_position, row.joint_raw = placed(self.angles, joints), placed(self.shown, joints)
        row.joint_output = placed(self.applied, joints)
        row.contact_ticks, row.clipped = self.contact_ticks, guard.clipped
        row.ramping = guard.ramping if is_led or not self._by_button else RELEASED

    def halt(self, now: float) -> None:
        self.arm.follow(self.applied, now)
