"""Builds the sides of a session in joint space: a leader arm and a follower arm, from a configuration."""

from collections.abc import Callable, Iterator, Sequence
from math import inf
from operator import mul, truediv
from typing import Any

from weberlink.arms.contract import ArmSpec, FollowerArm, LeaderArm
from weberlink.codec.bundle import BundleChannel, BundleDecoder, BundleEncoder
from weberlink.codec.quantizer import INT16_MAX
from weberlink.control.joints import JointParameters, build_joint_master, build_joint_slave
from weberlink.control.tuning import LiveSettings
from weberlink.geometry.joints import Joints
from weberlink.master.leader_port import LeaderPort, PressedAxes
from weberlink.master.mapping.mapped_leader import MappedLeader
from weberlink.master.safety import ForceGate
from weberlink.protocol import Role
from weberlink.protocol.events import Address
from weberlink.protocol.liveness import FADE_SHARE, HORIZON_SHARE
from weberlink.protocol.security import Security
from weberlink.realtime.stall import Watchdog
from weberlink.slave.follower_port import FollowerPort
from weberlink.system.channels import IncomingChannel, OutgoingChannel
from weberlink.system.composition.channels import joint_streams
from weberlink.system.composition.link import (
    ANONYMOUS,
    Entropy,
    Identity,
    Stopwatch,
    build_endpoint,
    construct,
    located,
    tuning_of,
)
from weberlink.system.composition.master import check_button, check_force_ends
from weberlink.system.configuration import Configuration, ConfigurationError, System
from weberlink.system.configuration.joints import (
    AngleCodecSettings,
    FollowerLimits,
    GripperCodecSettings,
    JointCodecSettings,
    LeaderLimits,
    per_axis,
)
from weberlink.system.rows import JointRows
from weberlink.system.side import Side

SLEW_S = 0.05
"""Time in which the torque of a leader may rise to its largest, where the file does not say otherwise [s]."""


def build_leading(
    configuration: Configuration,
    *,
    security: Security,
    entropy: Entropy,
    epoch: float,
    stopwatch: Stopwatch,
    peer: Address,
    identity: Identity = ANONYMOUS,
) -> Side:
    """The operator's side, not yet open.

    Raises:
        ConfigurationError: if the leader cannot do what the file asks.
    """
    system, leader = configuration.system, build_leader(configuration)
    forward, backward = joint_streams(system)
    limits = system.master.limits
    most, slew = torque_limits(system, leader.spec)
    control = build_joint_master(system.control.scheme, _parameters(system, leader.spec, most))
    endpoint = build_endpoint(system, Role.INITIATOR, security, entropy, epoch, forward, backward, peer, identity)
    silence, engage = system.link.silence_ms * 1e-3, system.master.engage
    decoders = [BundleDecoder(channel) for channel in backward]
    port = LeaderPort(
        arm=leader,
        control=control,
        endpoint=endpoint,
        gate=ForceGate(ramp=limits.ramp_ms * 1e-3, silence=silence, fade_share=FADE_SHARE),
        most=most,
        slew=slew,
        button=None if engage is None else engage.button,
        pressed=_pressed(system, lambda: tuning.settings.weber),
    )

    def retune(settings: LiveSettings, peer_tick: float) -> None:
        decoders[0].retune(settings.weber, peer_tick)

    tuning = tuning_of(system, control, retune, leads=True)
    return Side(
        port=port,
        outgoing=_outgoing(("joint_angle", "gripper_angle"), forward, (port.joints, port.gripper)),
        incoming=_incoming(("joint_torque", "gripper_torque"), decoders),
        tuning=tuning,
        endpoint=endpoint,
        tick_period=system.tick_period,
        horizon=HORIZON_SHARE * silence,
        watchdog=Watchdog(limits.device_ms * 1e-3),
        stopwatch=stopwatch,
        rows=JointRows,
    )


def build_following(
    configuration: Configuration,
    *,
    security: Security,
    entropy: Entropy,
    epoch: float,
    stopwatch: Stopwatch,
    identity: Identity = ANONYMOUS,
) -> Side:
    """The teleoperator's side, not yet open.

    Raises:
        ConfigurationError: if the follower cannot be made as the file asks.
    """
    system, follower = configuration.system, build_follower(configuration)
    forward, backward = joint_streams(system)
    spec, limits = follower.spec, system.slave.limits
    own = limits.joints or FollowerLimits()
    lower, upper = angle_limits(system, spec)
    control = build_joint_slave(system.control.scheme, _parameters(system, spec, spec.torque_nm))
    endpoint = build_endpoint(system, Role.RESPONDER, security, entropy, epoch, backward, forward, None, identity)
    port = FollowerPort(
        arm=follower,
        control=control,
        endpoint=endpoint,
        lower=lower,
        upper=upper,
        speed=own.speed_rad_s,
        approach_speed=own.approach_rad_s,
        ramp=limits.ramp_ms * 1e-3,
        press=_within("slave.limits.joints.press_nm", own.press_nm, spec.torque_nm),
        trip=_within("slave.limits.joints.trip_nm", own.trip_nm, spec.torque_nm),
        by_button=system.master.engage is not None,
    )
    encoders = [BundleEncoder(channel) for channel in backward]

    def retune(settings: LiveSettings, peer_tick: float) -> None:  # noqa: ARG001 - the encoder decides from now on
        encoders[0].retune(settings.weber)

    outgoing = _outgoing(("joint_torque", "gripper_torque"), backward, (port.joints, port.gripper), encoders)
    return Side(
        port=port,
        outgoing=outgoing,
        incoming=_incoming(("joint_angle", "gripper_angle"), [BundleDecoder(channel) for channel in forward]),
        tuning=tuning_of(system, control, retune, leads=False),
        endpoint=endpoint,
        tick_period=system.tick_period,
        horizon=HORIZON_SHARE * system.link.silence_ms * 1e-3,
        watchdog=Watchdog(limits.robot_ms * 1e-3),
        stopwatch=stopwatch,
        rows=JointRows,
    )


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


def _outgoing(
    names: Sequence[str],
    channels: Sequence[BundleChannel],
    sensors: Sequence[Any],
    encoders: Sequence[BundleEncoder] | None = None,
) -> list[OutgoingChannel]:
    made = [BundleEncoder(channel) for channel in channels] if encoders is None else encoders
    return [
        OutgoingChannel(name, stream, encoder, sensor)
        for stream, (name, encoder, sensor) in enumerate(zip(names, made, sensors, strict=False))
    ]


def _incoming(names: Sequence[str], decoders: Sequence[BundleDecoder]) -> list[IncomingChannel]:
    return [
        IncomingChannel(name, stream, decoder)
        for stream, (name, decoder) in enumerate(zip(names, decoders, strict=False))
    ]


@located
def build_leader(configuration: Configuration) -> LeaderArm:
    """The leader in the frame of the follower, not yet open.

    Raises:
        ConfigurationError: if it cannot be made of its options, has other joints than the file, or the wire cannot say
            its angles.
    """
    system, part = configuration.system, configuration.device
    assert part is not None
    leader: LeaderArm = construct("master.device", part.driver, part.options, system.tick_period, contract=LeaderArm)
    check_force_ends(leader, system.master.device.driver, system.master.accept_no_watchdog)
    mapping = system.master.joint_mapping
    if mapping is not None:
        leader = construct(
            "master.joint_mapping", MappedLeader, leader, mapping, joint_names(system), has_gripper(system)
        )
    _check_axes("master.device", leader.spec, system)
    _check_angles("master.device", leader.spec, system)
    check_button(system, leader.spec)
    torque_limits(system, leader.spec)
    return leader


@located
def build_follower(configuration: Configuration) -> FollowerArm:
    """The follower, not yet open.

    Raises:
        ConfigurationError: as `build_leader`.
    """
    system, part = configuration.system, configuration.robot
    assert part is not None
    follower: FollowerArm = construct(
        "slave.robot", part.driver, part.options, system.tick_period, contract=FollowerArm
    )
    _check_axes("slave.robot", follower.spec, system)
    _check_angles("slave.robot", follower.spec, system)
    angle_limits(system, follower.spec)
    _, backward = joint_streams(system)
    largest = max(follower.spec.torque_nm)
    limit = backward[0].limit
    if largest > limit:
        raise ConfigurationError(
            f"codec.joints.torque.step_nm: spans {limit:g} N m but slave.robot measures up to {largest:g} N m; use a "
            f"step of at least {largest / INT16_MAX:.2g}"
        )
    return follower


def joint_names(system: System) -> tuple[str, ...]:
    assert system.codec.joints is not None
    return system.codec.joints.names


def has_gripper(system: System) -> bool:
    return system.codec.gripper is not None


def axes_of(system: System) -> int:
    """Number of axes: the joints, and the gripper."""
    return len(joint_names(system)) + has_gripper(system)


def torque_limits(system: System, spec: ArmSpec) -> tuple[Joints, Joints]:
    """The largest torques [N m] and their fastest changes [N m/s] on the axes of a leader.

    Raises:
        ConfigurationError: a limit has not one value for each axis.
    """
    own = system.master.limits.joints or LeaderLimits()
    most = _within("master.limits.joints.torque_nm", own.torque_nm, spec.torque_nm)
    if own.slew_nm_s is None:
        return most, tuple(max(torque, 1e-3) / SLEW_S for torque in most)
    return most, _each("master.limits.joints.slew_nm_s", own.slew_nm_s, spec.axes)


def angle_limits(system: System, spec: ArmSpec) -> tuple[Joints, Joints]:
    """The range of commanded angles of a follower: its own within that of the file [rad].

    Raises:
        ConfigurationError: nothing of it is left for an axis, or a limit has not one value for each axis.
    """
    own = system.slave.limits.joints or FollowerLimits()
    lower, upper = spec.lower, spec.upper
    if own.lower_rad is not None:
        lower = tuple(map(max, lower, _each("slave.limits.joints.lower_rad", own.lower_rad, spec.axes)))
    if own.upper_rad is not None:
        upper = tuple(map(min, upper, _each("slave.limits.joints.upper_rad", own.upper_rad, spec.axes)))
    for axis, low, high in zip((*spec.joints, "gripper"), lower, upper, strict=False):
        if not low < high:
            raise ConfigurationError(f"slave.limits.joints: leaves nothing of the range of {axis}")
    return lower, upper


def _within(where: str, setting: float | tuple[float, ...] | None, most: Joints) -> Joints:
    return most if setting is None else tuple(map(min, most, _each(where, setting, len(most))))


def _each(where: str, setting: float | tuple[float, ...], count: int) -> Joints:
    try:
        return per_axis(setting, count)
    except ValueError as error:
        raise ConfigurationError(f"{where}: {error}") from None


def _check_axes(where: str, spec: ArmSpec, system: System) -> None:
    names = joint_names(system)
    if spec.joints != names:
        raise ConfigurationError(
            f"codec.joints.names: {', '.join(names)}; but {where} {spec.name} has {', '.join(spec.joints)}"
            + ("; map its axes with master.joint_mapping" if where == "master.device" else "; use these names")
        )
    if spec.gripper is not has_gripper(system):
        raise ConfigurationError(
            f"codec.gripper: {where} {spec.name} has {'a' if spec.gripper else 'no'} gripper; "
            + ("add gripper: {} under codec" if spec.gripper else "leave it out")
        )


def _check_angles(where: str, spec: ArmSpec, system: System) -> None:
    """A wire that cannot say an angle would move the arm elsewhere."""
    limit = joint_streams(system)[0][0].limit
    reach = max(map(abs, (*spec.lower, *spec.upper)))
    if reach > limit:
        raise ConfigurationError(
            f"codec.joints.angle.step_rad: spans {limit:g} rad but {where} reaches {reach:g} rad; use a step of at "
            f"least {reach / INT16_MAX:.2g}"
        )


def _parameters(system: System, spec: ArmSpec, torque: Joints) -> JointParameters:
    own = system.slave.limits.joints or FollowerLimits()
    return JointParameters(
        tick_period=system.tick_period,
        torque_range=torque,
        level=system.control.level_j,
        damping=system.control.damping_n_s_m,
        catch_up_rad_s=own.approach_rad_s,
        coupling=spec.stiffness_nm_rad,
    )


def notes(configuration: Configuration) -> Iterator[str]:
    """What a person should know before a run of arms.

    Raises:
        ConfigurationError: as `build_leader` and `build_follower`.
    """
    leader = None if configuration.device is None else build_leader(configuration)
    follower = None if configuration.robot is None else build_follower(configuration)
    if leader is not None:
        if not leader.spec.force_feedback:
            yield f"master.device: {leader.spec.name} displays no torque; nothing is felt"
        yield from _of_arm("master.device", leader.spec)
    if follower is not None:
        if not follower.spec.force_feedback:
            yield f"slave.robot: {follower.spec.name} measures no torque; nothing is felt"
        yield from _coupling(configuration.system, follower.spec)
        yield from _of_arm("slave.robot", follower.spec)


def _coupling(system: System, spec: ArmSpec) -> Iterator[str]:
    """What to say of the coupling in the file, beside that of the follower."""
    joints, gripper = system.codec.joints, system.codec.gripper
    assert joints is not None
    count = len(joints.names)
    parts: list[tuple[str, JointCodecSettings | GripperCodecSettings, Joints]]
    parts = [("joints", joints, spec.stiffness_nm_rad[:count])]
    if gripper is not None:
        parts.append(("gripper", gripper, spec.stiffness_nm_rad[count:]))
    for part, coded, own in parts:
        stated, bounds = coded.angle.coupling_nm_rad, per_axis(coded.angle.bound_rad, len(own))
        floors = per_axis(coded.torque.floor_nm, len(own))
        jump = max(map(truediv, map(mul, own, bounds), floors))
        field = f"codec.{part}.angle.coupling_nm_rad"
        if stated is None and jump > 1.0 and max(own) < inf:
            yield (
                f"{field}: not given, so an unsent error of an angle may change the torque by {jump:.2g} deadbands; "
                f"give that of {spec.name}, {max(own):.3g}"
            )
        elif stated is not None and max(per_axis(stated, len(own))) < 0.5 * max(own) < inf:
            most = max(per_axis(stated, len(own)))
            yield f"{field} {most:g}: {spec.name} is stiffer, {max(own):.3g} N m/rad; give that"


def _of_arm(where: str, spec: ArmSpec) -> Iterator[str]:
    if spec.force_feedback and not spec.calibrated:
        yield f"{where}: the torques of {spec.name} follow from data sheets, not from a calibration"
    if spec.note:
        yield f"{where}: {spec.note}"
