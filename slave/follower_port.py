"""The teleoperator's end of the link with an arm: it follows the leader joint by joint, and its torques are sensed."""

from collections.abc import Sequence
from typing import Any, ClassVar

from weberlink.arms.contract import ArmFault, ArmReading, FollowerArm
from weberlink.arms.sensor import AxesSensor
from weberlink.control.ends import Control
from weberlink.geometry.joints import Joints
from weberlink.slave.guard import Guard, PressLimit
from weberlink.slave.robot_port import TeleoperatorPort
from weberlink.telemetry.row import Row, placed

TRIP_RETREAT = 0.05
"""How far an axis that trips backs off [rad]: 1 cm at the end of 20 cm. Chosen."""
CONTACT_SHARE = 0.1
"""An axis is in contact from this share of its largest press on; less is friction of gears and noise. Chosen."""
DAMPING_MOST = 4.0
"""Largest damping of what an axis touches that the press limit provides for [N m s/rad]: 100 N s/m at the end of 20 cm.
Chosen."""
FULL_SHARE = 0.95
"""Share of the largest press that counts as all of it: filtered, a measurement that saturates stays below. Chosen."""


def axis_press_limit(most: float, stiffness: float, noise: float) -> PressLimit:
    """The press limit of an axis.

    `most` is the largest torque on the environment [N m], 0 for an axis that measures none; `stiffness` that of its
    position control [N m/rad]; a contact below the `noise` of a measured torque [N m] is none.
    """
    contact = min(most, max(CONTACT_SHARE * most, noise))
    return PressLimit(most, stiffness, damping=DAMPING_MOST, contact=contact, retreats_from=FULL_SHARE * most)


class FollowerPort(TeleoperatorPort):
    """A follower arm behind its guard.

    Vectors have one entry for each axis: the joints in order and, where there is one, the gripper last.
    """

    fault: ClassVar[type[Exception]] = ArmFault

    def __init__(
        self,
        arm: FollowerArm,
        *,
        guard: Guard,
        sensors: Sequence[AxesSensor],
        by_button: bool = False,
    ) -> None:
        super().__init__(arm, guard=guard, command=arm.follow, controls=(Control(),), by_button=by_button)
        self.angle_range, self._sensors = (guard.lower, guard.upper), sensors
        self._sensor = sensors[0]
        for sensor in sensors:
            sensor.shown = self.shown

    def _take(self, reading: ArmReading) -> None:
        self.where, self.felt = reading.angles, reading.torques

    def _settled(self, reading: ArmReading) -> Joints:
        return self.guard.near(reading.angles)

    def _wanted(self, values: Sequence[Any], elapsed: float) -> Joints | None:  # noqa: ARG002
        commanded: Joints = ()
        for value in values:
            if value is None:  # the guard holds where one is not finite
                return None
            commanded += value
        return commanded + self.applied[len(commanded) :]  # a gripper that the session does not lead

    def report(self, row: Row, *, is_led: bool) -> None:
        super().report(row, is_led=is_led)
        joints = len(self._sensors[0].value)
        row.joint_position, row.joint_raw = placed(self.where, joints), placed(self.shown(self.felt), joints)
        row.joint_output = placed(self.applied, joints)
