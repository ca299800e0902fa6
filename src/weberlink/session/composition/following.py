"""Builds the teleoperator's side of a session of arms, from a configuration."""

from weberlink.arms.contract import ArmSpec, FollowerArm
from weberlink.arms.sensor import sensors_of
from weberlink.codec import Decoder, Encoder
from weberlink.codec.sample import INT16_MAX
from weberlink.config import Configuration, ConfigurationError, System
from weberlink.config.joints import FollowerLimits
from weberlink.geometry.joints import Joints
from weberlink.session.channels import IncomingChannel, OutgoingChannel
from weberlink.session.composition.arms import (
    check_angles,
    check_arm_axes,
    each_axis,
    within,
)
from weberlink.session.composition.channels import streams
from weberlink.session.composition.link import (
    Parts,
    build_driver,
    build_tuning,
    with_file_name,
)
from weberlink.slave.follower_port import TRIP_RETREAT, FollowerPort, axis_press_limit
from weberlink.slave.guard import Guard


def build_following(configuration: Configuration) -> Parts:
    """The port of a follower arm, its channels out and in, and the settings that may change."""
    system, follower = configuration.system, build_follower(configuration)
    forward, backward = streams(system)
    spec, limits = follower.spec, system.slave.limits
    own = limits.joints or FollowerLimits()
    lower, upper = angle_limits(system, spec)
    presses = within("slave.limits.joints.press_nm", own.press_nm, spec.torque_nm)
    sensors = sensors_of(spec, "torques")
    port = FollowerPort(
        follower,
        guard=Guard(
            [1] * spec.axes,
            presses=[
                axis_press_limit(most, stiffness, spec.torque_error_nm)
                for most, stiffness in zip(presses, spec.stiffness_nm_rad, strict=True)
            ],
            lower=lower,
            upper=upper,
            trips=within("slave.limits.joints.trip_nm", own.trip_nm, spec.torque_nm),
            speed=own.speed_rad_s,
            approach_speed=own.approach_rad_s,
            ramp=limits.ramp_ms * 1e-3,
            trip_retract=TRIP_RETREAT,
        ),
        angle_range=(lower, upper),
        sensors=sensors,
        by_button=system.master.engage is not None,
    )
    outgoing = [
        OutgoingChannel(name, stream, Encoder(backward[stream]), sensor)
        for stream, (name, sensor) in enumerate(zip(("joint_torque", "gripper_torque"), sensors, strict=False))
    ]
    incoming = [
        IncomingChannel(name, stream, Decoder(channel))
        for stream, (name, channel) in enumerate(zip(("joint_angle", "gripper_angle"), forward, strict=False))
    ]

    return port, outgoing, incoming, build_tuning(system, outgoing[0].encoder)


@with_file_name
def build_follower(configuration: Configuration) -> FollowerArm:
    """The follower, not yet open.

    Raises:
        ConfigurationError: as `build_leader`.
    """
    system, part = configuration.system, configuration.robot
    assert part is not None
    follower: FollowerArm = build_driver(
        "slave.robot", part.driver, part.options, system.tick_period, contract=FollowerArm
    )
    check_arm_axes("slave.robot", follower.spec, system)
    check_angles("slave.robot", follower.spec, system)
    angle_limits(system, follower.spec)
    _, backward = streams(system)
    largest = max(follower.spec.torque_nm)
    limit = backward[0].value_quantizer.limit
    if largest > limit:
        raise ConfigurationError(
            f"codec.joints.torque.step_nm: spans {limit:g} N m but slave.robot measures up to {largest:g} N m; use a "
            f"step of at least {largest / INT16_MAX:.2g}"
        )
    return follower


def angle_limits(system: System, spec: ArmSpec) -> tuple[Joints, Joints]:
    """The range of commanded angles of a follower: its own within that of the file [rad].

    Raises:
        ConfigurationError: nothing of it is left for an axis, or a limit has not one value for each axis.
    """
    own = system.slave.limits.joints or FollowerLimits()
    lower, upper = spec.lower, spec.upper
    if own.lower_rad is not None:
        lower = tuple(map(max, lower, each_axis("slave.limits.joints.lower_rad", own.lower_rad, spec.axes)))
    if own.upper_rad is not None:
        upper = tuple(map(min, upper, each_axis("slave.limits.joints.upper_rad", own.upper_rad, spec.axes)))
    for axis, low, high in zip((*spec.joints, "gripper"), lower, upper, strict=False):
        if not low < high:
            raise ConfigurationError(f"slave.limits.joints: leaves nothing of the range of {axis}")
    return lower, upper
