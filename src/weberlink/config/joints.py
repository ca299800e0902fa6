"""The settings of a session in joint space: an arm led and followed joint by joint, and its gripper.

A setting for each axis is one number for all of them, or a list with one for each: the joints in order and, in
limits, the gripper last where `codec.gripper` is given.
"""

from collections.abc import Iterator
from typing import Annotated, TypeVar

from pydantic import Field

from weberlink.config.settings import PredictorFor, Settings
from weberlink.geometry.joints import MOST_JOINTS, Joints

JointName = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$")]
JointPredictor = Annotated[str, PredictorFor("joints")]

_Angle = Annotated[float, Field(gt=0, le=1)]
_Floor = Annotated[float, Field(gt=0, le=10)]
_Stiffness = Annotated[float, Field(ge=1e-3, le=1e5)]
_Torque = Annotated[float, Field(ge=1e-4, le=1e4)]
_Slew = Annotated[float, Field(ge=1e-3, le=1e9)]
_Range = Annotated[float, Field(ge=-100, le=100)]
_T = TypeVar("_T")
_Each = Annotated[tuple[_T, ...], Field(max_length=MOST_JOINTS + 1)]


def per_axis(setting: float | tuple[float, ...], count: int) -> Joints:
    """One value for each of `count` axes; raises ValueError if there are more or fewer."""
    if isinstance(setting, tuple):
        if len(setting) != count:
            raise ValueError(f"has {len(setting)} values for {count} axes; give one for each, or one number for all")
        return setting
    return (setting,) * count


class AngleCodecSettings(Settings):
    """The forward channel: angles [rad]."""

    predictor: JointPredictor = "linear"
    """What both ends predict with."""
    bound_rad: _Angle | tuple[_Angle, ...] = 0.005
    """Error that stays unsent, for all or for each [rad]. Chosen: a third of the JND of a person's shoulder angle,
    0.8 degrees (Tan et al., 1994); other joints of a person discern less."""
    coupling_nm_rad: _Stiffness | tuple[_Stiffness, ...] | None = None
    """Stiffness of the follower towards its commanded angles, for all or for each [N m/rad]: where it presses, an error
    stays unsent only if it changes the torque by less than the deadband of the torque. None to leave that out."""
    step_rad: float = Field(default=0.0002, ge=0.0001, le=0.01)
    """Wire step [rad]; 16 bits span +-32767 steps."""
    max_updates_per_s: float | None = Field(default=None, ge=1, le=10_000)
    """Largest rate of updates in the long run; None for no limit."""


class JointTorqueCodecSettings(Settings):
    """The backward channel: torques [N m]."""

    predictor: JointPredictor = "zoh"
    """What both ends predict with."""
    weber: float = Field(default=0.13, ge=0, lt=1)
    """Weber factor of the torque of each axis: 12.7 % of 60 mN m was found with two fingers (Jandura and Srinivasan,
    1994)."""
    floor_nm: _Floor | tuple[_Floor, ...] = 0.02
    """Absolute threshold, for all or for each, below which Weber's law fails [N m]. Chosen: above the noise of the
    current of small servos; nobody has published a threshold for leader arms."""
    step_nm: float = Field(default=0.0005, gt=0, le=1)
    """Wire step [N m]; 16 bits span +-32767 steps."""
    max_updates_per_s: float | None = Field(default=None, ge=1, le=10_000)
    """Largest rate of updates in the long run; None for no limit."""


class JointCodecSettings(Settings):
    """The joints of an arm: angles forward, torques back, each vector with updates of its own."""

    names: tuple[JointName, ...] = Field(min_length=1, max_length=MOST_JOINTS)
    """Of the joints of the follower in order, without the gripper."""
    angle: AngleCodecSettings = AngleCodecSettings()
    torque: JointTorqueCodecSettings = JointTorqueCodecSettings()

    def contradictions(self) -> Iterator[str]:
        if len(set(self.names)) != len(self.names):
            yield "names: names each joint once"
        for name, setting in (
            ("angle.bound_rad", self.angle.bound_rad),
            ("angle.coupling_nm_rad", self.angle.coupling_nm_rad),
            ("torque.floor_nm", self.torque.floor_nm),
        ):
            try:
                per_axis(setting or 0.0, len(self.names))
            except ValueError as error:
                yield f"{name} {error}"


class GripperAngleSettings(AngleCodecSettings):
    """The forward channel of the gripper: the angle of its motor, 0 closed [rad]."""

    bound_rad: _Angle = 0.01
    """Error that stays unsent [rad]. Chosen: less than 1 mm at the tips of the fingers of small arms."""
    coupling_nm_rad: _Stiffness | None = None
    """Stiffness of the gripper of the follower [N m/rad], as for the joints."""


class GripperTorqueSettings(JointTorqueCodecSettings):
    """The backward channel of the gripper: the torque of its motor [N m]."""

    floor_nm: _Floor = 0.02
    """Absolute threshold below which Weber's law fails [N m]. Chosen as for the joints."""


class GripperCodecSettings(Settings):
    """The gripper: one more axis, with updates of its own."""

    angle: GripperAngleSettings = GripperAngleSettings()
    torque: GripperTorqueSettings = GripperTorqueSettings()


class LeaderLimits(Settings):
    """What protects the operator of a leader arm, on top of its own limits; a value for each axis, or one for all."""

    torque_nm: _Torque | _Each[_Torque] | None = None
    """Largest torque [N m]; by default the largest of the leader."""
    slew_nm_s: _Slew | _Each[_Slew] | None = None
    """Fastest change of torque [N m/s]; by default to the largest torque in 50 ms."""


class FollowerLimits(Settings):
    """What protects a follower arm and what it touches, on top of its own limits; for each axis, or one for all."""

    lower_rad: _Range | _Each[_Range] | None = None
    """Least commanded angles [rad]; by default those of the arm."""
    upper_rad: _Range | _Each[_Range] | None = None
    """Largest commanded angles [rad]; by default those of the arm."""
    speed_rad_s: float = Field(default=3.0, ge=1e-3, le=1000)
    """Largest speed of an axis while following [rad/s]."""
    approach_rad_s: float = Field(default=0.5, ge=1e-3, le=1000)
    """Speed at which it approaches the leader's angles after an engagement [rad/s]."""
    press_nm: _Torque | _Each[_Torque] | None = None
    """Largest torque with which an axis presses [N m]; by default the largest that the arm measures."""
    trip_nm: _Torque | _Each[_Torque] | None = None
    """Torque of an axis above which the arm stops following [N m]; by default the largest that the arm measures."""
