"""The coded channels of an arm, as both sides build them from a configuration."""

from weberlink.codec.bundle import BundleChannel, joint_channel
from weberlink.config import System
from weberlink.config.joints import AngleCodecSettings, JointTorqueCodecSettings, per_axis
from weberlink.session.composition.channels import rate_of


def joint_streams(system: System) -> tuple[tuple[BundleChannel, ...], tuple[BundleChannel, ...]]:
    """All forward and all backward channels of an arm by stream: its joints and, where it has one, its gripper."""
    joints, gripper = system.codec.joints, system.codec.gripper
    assert joints is not None
    forward = [_angles(joints.angle, len(joints.names), system)]
    backward = [_torques(joints.torque, len(joints.names), system)]
    if gripper is not None:
        forward.append(_angles(gripper.angle, 1, system))
        backward.append(_torques(gripper.torque, 1, system))
    return tuple(forward), tuple(backward)


def _angles(settings: AngleCodecSettings, count: int, system: System) -> BundleChannel:
    return joint_channel(
        predictor=settings.predictor,
        bounds=per_axis(settings.bound_rad, count),
        step=settings.step_rad,
        tick_period=system.tick_period,
        rate=rate_of(settings.max_updates_per_s, system),
    )


def _torques(settings: JointTorqueCodecSettings, count: int, system: System) -> BundleChannel:
    return joint_channel(
        predictor=settings.predictor,
        bounds=per_axis(settings.floor_nm, count),
        weber=settings.weber,
        step=settings.step_nm,
        tick_period=system.tick_period,
        rest=(0.0,) * count,
        rate=rate_of(settings.max_updates_per_s, system),
    )
