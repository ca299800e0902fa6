"""A leader arm in the frame of the follower: other joints, scales, offsets and torques."""

from dataclasses import replace
from math import inf
from typing import NamedTuple

from weberlink.arms.contract import Arm, ArmReading, ArmSpec
from weberlink.arms.mapping import GripperMappingSettings, JointMappingSettings, LeaderMappingSettings
from weberlink.geometry.joints import Joints, is_finite


class Axis(NamedTuple):
    """What drives an axis of the follower: angle = offset + scale * angle of the leader's axis `source` [rad], within
    low to high; source -1 for none, the angle is the offset.
    """

    source: int
    scale: float
    offset: float
    low: float = -inf
    high: float = inf

    def angle(self, leader: Joints) -> float:
        """The angle of the follower [rad]; NaN stays NaN."""
        angle = self.offset if self.source < 0 else self.offset + self.scale * leader[self.source]
        return self.low if angle < self.low else self.high if angle > self.high else angle


class MappedLeader:
    """Maps the readings and the torques of another leader; a `weberlink.arms.contract.Arm`.

    With the map of angles q = b + S p, the torques on the leader are torque_scale * S^T tau: of equal work, but for the
    one factor. Raises ValueError if the map names a joint that there is not, drives one twice, or leaves one without a
    drive.
    """

    def __init__(self, arm: Arm, settings: LeaderMappingSettings, joints: tuple[str, ...], gripper: bool) -> None:
        own, share = arm.spec, settings.torque_scale
        self._arm = arm
        self._axes = axes(own, settings, joints, gripper=gripper)
        self._torque_scale = share
        ends = [(axis.angle(own.lower), axis.angle(own.upper)) for axis in self._axes]
        torques, stiffness = [0.0] * len(self._axes), [0.0] * len(self._axes)
        for place, axis in enumerate(self._axes):
            if axis.source >= 0:
                torques[place] = own.torque_nm[axis.source] / (share * abs(axis.scale))
                stiffness[place] = own.stiffness_nm_rad[axis.source] / (share * axis.scale**2)
        self.spec: ArmSpec = replace(
            own,
            joints=joints,
            gripper=gripper,
            lower=tuple(map(min, ends)),
            upper=tuple(map(max, ends)),
            torque_nm=tuple(torques),
            # An axis that is not driven displays nothing: as stiff as the stiffest.
            stiffness_nm_rad=tuple(each or max(stiffness) for each in stiffness),
        )
        self._read: ArmReading | None = None
        self._mapped: ArmReading | None = None

    @property
    def trouble(self) -> str | None:
        return getattr(self._arm, "trouble", None)

    def open(self, now: float) -> None:
        self._read = self._mapped = None
        self._arm.open(now)

    def latest(self, now: float) -> ArmReading:
        reading = self._arm.latest(now)
        if self._mapped is None or reading is not self._read:
            self._read = reading
            self._mapped = reading._replace(
                angles=tuple([axis.angle(reading.angles) for axis in self._axes]), torques=(0.0,) * len(self._axes)
            )
        return self._mapped

    def command(self, values: Joints, now: float) -> None:
        if not is_finite(values):
            raise ValueError(f"{self.spec.name}: commanded torques that are not finite: {values}")
        felt = [0.0] * self._arm.spec.axes
        for axis, torque in zip(self._axes, values, strict=True):
            if axis.source >= 0:
                felt[axis.source] = self._torque_scale * axis.scale * torque
        self._arm.command(tuple(felt), now)

    def close(self) -> None:
        self._arm.close()


def axes(leader: ArmSpec, settings: LeaderMappingSettings, joints: tuple[str, ...], *, gripper: bool) -> list[Axis]:
    """What drives each axis of the follower; raises as `MappedLeader`."""
    unknown = [name for name in settings.joints if name not in joints]
    if unknown:
        raise ValueError(f"joints.{unknown[0]}: the follower has {', '.join(joints)}")
    found = [
        _joint(leader, settings, name, place, settings.joints.get(name, JointMappingSettings()))
        for place, name in enumerate(joints)
    ]
    driven: dict[int, str] = {}
    for name, axis in zip(joints, found, strict=True):
        if axis.source >= 0 and driven.setdefault(axis.source, name) != name:
            raise ValueError(
                f"joints.{name}: {leader.joints[axis.source]} of {leader.name} drives {driven[axis.source]} already; "
                "give another leader, or rest_rad"
            )
    if gripper:
        found.append(_gripper(leader, settings.gripper))
    if not any(axis.source >= 0 for axis in found):
        raise ValueError(f"{leader.name} drives no axis of the follower; let one joint at least have no rest_rad")
    return found


def _joint(
    leader: ArmSpec, settings: LeaderMappingSettings, name: str, place: int, joint: JointMappingSettings
) -> Axis:
    if joint.rest_rad is not None:
        return Axis(-1, 1.0, joint.rest_rad)
    wanted = joint.leader or (name if settings.match == "name" else None)
    if wanted is None and place < len(leader.joints):
        return Axis(place, joint.scale, joint.offset_rad)
    if wanted is None or wanted not in leader.joints:
        lacks = f"no joint {wanted}" if wanted else f"{len(leader.joints)} joints"
        raise ValueError(
            f"joints.{name}: {leader.name} has {lacks}; give leader, one of {', '.join(leader.joints)}, or rest_rad, "
            "the angle to stay at"
        )
    return Axis(leader.joints.index(wanted), joint.scale, joint.offset_rad)


def _gripper(leader: ArmSpec, gripper: GripperMappingSettings) -> Axis:
    if gripper.rest_rad is not None:
        return Axis(-1, 1.0, gripper.rest_rad)
    if not leader.gripper:
        raise ValueError(f"gripper: {leader.name} has none; give rest_rad, the angle to stay at")
    source = len(leader.joints)
    if gripper.follower_rad is None:
        return Axis(source, 1.0, 0.0)
    closed, opened = gripper.leader_rad or (leader.lower[source], leader.upper[source])
    if closed == opened:
        raise ValueError(f"gripper: {leader.name} states no range of its gripper; give leader_rad")
    shut, wide = gripper.follower_rad
    scale = (wide - shut) / (opened - closed)
    return Axis(source, scale, shut - scale * closed, min(shut, wide), max(shut, wide))
