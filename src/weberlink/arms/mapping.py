"""The settings of the map from a leader arm to the axes of a follower arm."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from weberlink.options import Options

Angle = Annotated[float, Field(ge=-100, le=100)]
Ends = tuple[Angle, Angle]


class JointMappingSettings(Options):
    """What drives a joint of the follower: angle = offset + scale * angle of a leader's joint."""

    leader: str | None = Field(default=None, min_length=1)
    """Name of the joint of the leader; left out, `match` finds it."""
    scale: float = Field(default=1.0, ge=-100, le=100)
    """Radians of the follower for a radian of the leader; negative to turn the other way, not 0."""
    offset_rad: Angle = 0.0  # angle of the follower where the leader is at 0 [rad]
    rest_rad: Angle | None = None
    """Angle at which the joint stays, driven by no joint of the leader [rad]; leave out to drive it."""

    @model_validator(mode="after")
    def _drives_or_rests(self) -> Self:
        if self.scale == 0.0:
            raise ValueError("scale must not be 0; for a joint that is not driven give rest_rad")
        if self.rest_rad is not None and self.model_fields_set != {"rest_rad"}:
            raise ValueError("rest_rad is for a joint that is not driven; leave out leader, scale and offset_rad")
        return self


class GripperMappingSettings(Options):
    """What drives the gripper of the follower: a range of the leader's angles, mapped to one of the follower's."""

    leader_rad: Ends | None = None  # angles of the leader, closed and open [rad]; its whole range if not given
    follower_rad: Ends | None = None
    """Angles of the follower at these [rad], which it never leaves; left out, it has the angle of the leader."""
    rest_rad: Angle | None = None  # angle at which the gripper stays, driven by nothing [rad]; leave out to drive it

    @model_validator(mode="after")
    def _drives_or_rests(self) -> Self:
        for name, ends in (("leader_rad", self.leader_rad), ("follower_rad", self.follower_rad)):
            if ends is not None and ends[0] == ends[1]:
                raise ValueError(f"{name}: closed and open must differ")
        if self.leader_rad is not None and self.follower_rad is None:
            raise ValueError("leader_rad needs follower_rad, the range that it is mapped to")
        if self.rest_rad is not None and self.follower_rad is not None:
            raise ValueError("rest_rad is for a gripper that is not driven; leave out follower_rad")
        return self


class LeaderMappingSettings(Options):
    """From the axes of a leader arm to those of the follower; all that is sent, recorded and reported is the latter's.

    A torque goes back by the transpose of the map of angles, and by `torque_scale`: so the leader's power is that of
    the follower times `torque_scale`, whatever the scales of the angles are.
    """

    match: Literal["order", "name"] = "order"
    """Which joint of the leader drives one of the follower that `joints` does not say it of: the one at the same
    place, or the one of the same name."""
    joints: dict[str, JointMappingSettings] = Field(default={})
    """By the name of the follower's joint; one that is not there is driven with a scale of 1 and no offset."""
    gripper: GripperMappingSettings = GripperMappingSettings()
    """The gripper; left out, that of the follower has the angle of the leader's."""
    torque_scale: float = Field(default=1.0, ge=1e-3, le=1000)
    """Newton metres on the leader for a newton metre on the follower, where the angle has a scale of 1."""
