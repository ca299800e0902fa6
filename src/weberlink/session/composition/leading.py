"""Builds the operator's side of a session of arms, from a configuration."""

from collections.abc import Callable

from weberlink.arms.contract import ArmSpec, LeaderArm
from weberlink.arms.sensor import sensors_of
from weberlink.codec import Decoder, Encoder
from weberlink.config import Configuration, System
from weberlink.config.joints import AngleCodecSettings, LeaderLimits, per_axis
from weberlink.control.axes import LEVER, build_axes
from weberlink.control.contract import FREE_FORCE, LEAST_CONTACT
from weberlink.geometry.joints import Joints
from weberlink.master.gate import Bound, ContactLimiter, ContactWatch
from weberlink.master.leader_port import LeaderPort, PressedAxes
from weberlink.protocol.endpoint import Endpoint
from weberlink.session.channels import IncomingChannel, OutgoingChannel
from weberlink.session.composition.arms import (
    check_angles,
    check_arm_axes,
    each_axis,
    has_gripper,
    joint_names,
    within,
)
from weberlink.session.composition.channels import account, longest_round_trip, signal_delay, streams
from weberlink.session.composition.link import (
    Parts,
    build_driver,
    build_tuning,
    with_file_name,
)
from weberlink.session.composition.master import build_gate, check_button, check_force_ends

SLEW_S = 0.05
"""Time in which the torque of a leader may rise to its largest, where the file does not say otherwise [s]."""


def build_leading(configuration: Configuration, endpoint: Endpoint) -> Parts:
    """The port of a leader arm, its channels out and in, and the settings that may change."""
    system, leader = configuration.system, build_leader(configuration)
    forward, backward = streams(system)
    decoders = [Decoder(channel) for channel in backward]
    most, slew = torque_limits(system, leader.spec)
    least, delay, ramp = _least(system), signal_delay(system), system.master.limits.ramp_ms * 1e-3
    sensors, bounds = sensors_of(leader.spec, "angles"), []
    for sensor in sensors:
        limiter = ContactLimiter(max(sensor.part(most)), FREE_FORCE * LEVER, longest_round_trip(system) + delay)
        contact = ContactWatch(limiter, endpoint, sensor.part(least), delay)
        bounds.append(Bound(sensor.part(most), sensor.part(slew), ramp, width=1, contact=contact))
    tuning = build_tuning(system, decoders[0])
    engage = system.master.engage
    port = LeaderPort(
        leader,
        control=build_axes(system.control.scheme, LEVER, account(system.control, system.master.mapping)),
        endpoint=endpoint,
        gate=build_gate(system, bounds),
        sensors=sensors,
        button=None if engage is None else engage.button,
        pressed=_pressed(system, lambda: tuning.settings.weber),
        displays_torque=any(limit > 0.0 for limit in most),
    )
    outgoing = [
        OutgoingChannel(name, stream, Encoder(forward[stream]), sensor)
        for stream, (name, sensor) in enumerate(zip(("joint_angle", "gripper_angle"), sensors, strict=False))
    ]
    incoming = [
        IncomingChannel(name, stream, decoder)
        for stream, (name, decoder) in enumerate(zip(("joint_torque", "gripper_torque"), decoders, strict=False))
    ]
    return port, outgoing, incoming, tuning


def _least(system: System) -> Joints:
    """Smallest torques that state a contact [N m]: less may be left over within the deadband."""
    joints, gripper = system.codec.joints, system.codec.gripper
    assert joints is not None
    floors = per_axis(joints.torque.floor_nm, len(joints.names))
    floors += () if gripper is None else (float(gripper.torque.floor_nm),)
    return tuple(max(LEAST_CONTACT * LEVER, floor) for floor in floors)


def _pressed(system: System, weber: Callable[[], float]) -> list[PressedAxes | None]:
    """What may stay unsent of pressed joints and of a pressed gripper; None where the file states no stiffness.

    Args:
        system: of both sides.
        weber: gives the Weber factor of the joints' torques, which a session may change.
    """
    joints, gripper = system.codec.joints, system.codec.gripper
    assert joints is not None
    floors = per_axis(joints.torque.floor_nm, len(joints.names))
    made = [_pressed_axes(joints.angle, len(floors), lambda axis, torque: max(weber() * torque, floors[axis]))]
    if gripper is not None:
        grip = gripper.torque
        made.append(_pressed_axes(gripper.angle, 1, lambda _, torque: max(grip.weber * torque, float(grip.floor_nm))))
    return made


def _pressed_axes(
    angle: AngleCodecSettings, count: int, torque_bound: Callable[[int, float], float]
) -> PressedAxes | None:
    if angle.coupling_nm_rad is None:
        return None
    return PressedAxes(per_axis(angle.bound_rad, count), per_axis(angle.coupling_nm_rad, count), torque_bound)


@with_file_name
def build_leader(configuration: Configuration) -> LeaderArm:
    """The leader in the frame of the follower, not yet open.

    Raises:
        ConfigurationError: if it cannot be made of its options, has other joints than the file, or the wire cannot say
            its angles.
    """
    system, part = configuration.system, configuration.device
    assert part is not None
    leader: LeaderArm = build_driver("master.device", part.driver, part.options, system.tick_period, contract=LeaderArm)
    check_force_ends(leader, system.master.device.driver, system.master.accept_no_watchdog)
    mapping = system.master.joint_mapping
    if mapping is not None:
        from weberlink.master.mapping.mapped_leader import MappedLeader  # noqa: PLC0415 - where a file asks for it

        leader = build_driver(
            "master.joint_mapping", MappedLeader, leader, mapping, joint_names(system), has_gripper(system)
        )
    check_arm_axes("master.device", leader.spec, system)
    check_angles("master.device", leader.spec, system)
    check_button(system, leader.spec)
    torque_limits(system, leader.spec)
    return leader


def torque_limits(system: System, spec: ArmSpec) -> tuple[Joints, Joints]:
    """The largest torques [N m] and their fastest changes [N m/s] on the axes of a leader.

    Raises:
        ConfigurationError: a limit has not one value for each axis.
    """
    own = system.master.limits.joints or LeaderLimits()
    most = within("master.limits.joints.torque_nm", own.torque_nm, spec.torque_nm)
    if own.slew_nm_s is None:
        return most, tuple(max(torque, 1e-3) / SLEW_S for torque in most)
    return most, each_axis("master.limits.joints.slew_nm_s", own.slew_nm_s, spec.axes)
