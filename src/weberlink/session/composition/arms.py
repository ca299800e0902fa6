"""Builds both ends of a session of arms, from a configuration."""

from collections.abc import Callable
from functools import partial

from weberlink.arms.contract import Arm, ArmFault, ArmSpec
from weberlink.arms.sensor import PressedAxes, sensors_of
from weberlink.codec import Decoder
from weberlink.config import Configuration, ConfigurationError, System
from weberlink.config.joints import FollowerLimits, JointCodecSettings, LeaderLimits, per_axis
from weberlink.control.contract import FREE_FORCE, LEAST_CONTACT
from weberlink.geometry.joints import Joints
from weberlink.protocol.endpoint import Endpoint
from weberlink.session.channels import IncomingChannel
from weberlink.session.composition.channels import account, check_span, longest_round_trip, signal_delay, streams
from weberlink.session.composition.link import build_driver, build_tuning
from weberlink.session.side import Parts

SLEW_S = 0.05  # time in which the torque of a leader may rise to its largest, where the file does not say otherwise [s]


def build_leading(configuration: Configuration, endpoint: Endpoint) -> Parts:
    """The port of a leader arm, its channels out and in, and the settings that may change."""
    from weberlink.control.axes import LEVER, build_axes  # noqa: PLC0415 - for this end alone
    from weberlink.master.gate import Bound, ContactLimiter, ContactWatch  # noqa: PLC0415 - likewise
    from weberlink.master.operator_port import Display  # noqa: PLC0415 - likewise
    from weberlink.session.composition.master import operator_port  # noqa: PLC0415 - likewise

    system, leader = configuration.system, build_leader(configuration)
    most, slew = torque_limits(system, leader.spec)
    sent, received = streams(system)
    sensors, incoming = sensors_of(leader.spec, "angles", sent), [IncomingChannel(Decoder(each)) for each in received]
    tuning = build_tuning(system, incoming[0].decoder)
    # Less torque than the deadband states no contact: it may be left over.
    parts = [(group.torque.floor_nm, count) for _, group, count in system.codec.arm]
    floors = tuple(floor for setting, count in parts for floor in per_axis(setting, count))
    least, delay = tuple(max(LEAST_CONTACT * LEVER, floor) for floor in floors), signal_delay(system)
    bounds = []
    for sensor in sensors:
        limiter = ContactLimiter(max(sensor.part(most)), FREE_FORCE * LEVER, longest_round_trip(system))
        contact = ContactWatch(limiter, endpoint, sensor.part(least), delay)
        ramp = system.master.limits.ramp_ms * 1e-3
        bounds.append(Bound(sensor.part(most), sensor.part(slew), ramp, width=1, contact=contact))

    def torque_bound(weber: float | None, floors: Joints, axis: int, torque: float) -> float:
        weber = tuning.settings.weber if weber is None else weber  # a session may change that of the joints
        return max(weber * torque, floors[axis])

    control = build_axes(system.control.scheme, LEVER, account(system.control, system.master.mapping))
    display = Display(control, sensors, leader.command if any(most) else None)
    for sensor, (name, group, count) in zip(sensors, system.codec.arm, strict=True):
        if group.angle.coupling_nm_rad is not None:
            bounds_rad, coupling = group.angle.bound_rad, group.angle.coupling_nm_rad
            bound = partial(torque_bound, None if name == "joints" else group.torque.weber, sensor.part(floors))
            sensor.pressed = PressedAxes(per_axis(bounds_rad, count), per_axis(coupling, count), bound)
            sensor.felt = display
    port = operator_port(system, leader, [display], bounds, endpoint, ArmFault)
    port.angle_range = leader.spec.lower, leader.spec.upper
    return Parts(port, sensors, incoming, tuning)


def build_following(configuration: Configuration, endpoint: Endpoint) -> Parts:
    """The port of a follower arm, its channels out and in, and the settings that may change."""
    from weberlink.slave.guard import TRIP_RETREAT, Guard, axis_press_limit  # noqa: PLC0415 - for this end alone
    from weberlink.slave.robot_port import RobotPort  # noqa: PLC0415 - likewise

    system, follower = configuration.system, build_follower(configuration)
    spec, limits = follower.spec, system.slave.limits
    own = limits.joints or FollowerLimits()
    workspace = angle_limits(system, spec)
    presses = within("slave.limits.joints.press_nm", own.press_nm, spec.torque_nm)
    received, sent = streams(system)
    sensors = sensors_of(spec, "torques", sent)
    guard = Guard(
        [
            axis_press_limit(most, stiffness, spec.torque_error_nm)
            for most, stiffness in zip(presses, spec.stiffness_nm_rad, strict=True)
        ],
        workspace=workspace,
        trips=within("slave.limits.joints.trip_nm", own.trip_nm, spec.torque_nm),
        speed=own.speed_rad_s,
        approach_speed=own.approach_rad_s,
        ramp=limits.ramp_ms * 1e-3,
        trip_retract=TRIP_RETREAT,
    )
    by_button = system.master.engage is not None
    port = RobotPort(follower, guard=guard, sensors=sensors, endpoint=endpoint, by_button=by_button, fault=ArmFault)
    port.angle_range = workspace
    incoming = [IncomingChannel(Decoder(each)) for each in received]
    return Parts(port, sensors, incoming, build_tuning(system, sensors[0].encoder))


def build_leader(configuration: Configuration) -> Arm:
    """The leader in the frame of the follower, not yet open; raises ConfigurationError if it cannot be made of its
    options, has other joints than the file, or the wire cannot say its angles."""
    from weberlink.session.composition.master import check_button, check_force_ends  # noqa: PLC0415 - for this end

    system, part = configuration.system, configuration.device
    assert part is not None
    leader: Arm = build_driver("master.device", part.driver, part.options, system.tick_period, contract=Arm)
    check_force_ends(leader, system.master.device.driver, system.master.accept_no_watchdog)
    mapping = system.master.joint_mapping
    if mapping is not None:
        from weberlink.master.mapping.mapped_leader import MappedLeader  # noqa: PLC0415 - where a file asks for it

        gripper = system.codec.gripper is not None
        leader = build_driver("master.joint_mapping", MappedLeader, leader, mapping, _joints(system).names, gripper)
    _check("master.device", leader.spec, system)
    check_button(system, leader.spec)
    torque_limits(system, leader.spec)
    return leader


def build_follower(configuration: Configuration) -> Arm:
    """The follower, not yet open; raises ConfigurationError as `build_leader`."""
    system, part = configuration.system, configuration.robot
    assert part is not None
    follower: Arm = build_driver("slave.robot", part.driver, part.options, system.tick_period, contract=Arm)
    _check("slave.robot", follower.spec, system)
    angle_limits(system, follower.spec)
    torques = streams(system)[1][0]
    check_span(
        "codec.joints.torque.step_nm", torques, "slave.robot measures up to", max(follower.spec.torque_nm), "N m"
    )
    return follower


def torque_limits(system: System, spec: ArmSpec) -> tuple[Joints, Joints]:
    """The largest torques [N m] and their fastest changes [N m/s] on the axes of a leader; raises ConfigurationError if
    a limit has not one value for each axis."""
    own = system.master.limits.joints or LeaderLimits()
    most = within("master.limits.joints.torque_nm", own.torque_nm, spec.torque_nm)
    if own.slew_nm_s is None:
        return most, tuple(max(torque, 1e-3) / SLEW_S for torque in most)
    return most, each_axis("master.limits.joints.slew_nm_s", own.slew_nm_s, spec.axes)


def angle_limits(system: System, spec: ArmSpec) -> tuple[Joints, Joints]:
    """The range of commanded angles of a follower: its own within that of the file [rad]; raises ConfigurationError if
    nothing of it is left for an axis, or a limit has not one value for each axis."""
    own = system.slave.limits.joints or FollowerLimits()
    lower = within("slave.limits.joints.lower_rad", own.lower_rad, spec.lower, max)
    upper = within("slave.limits.joints.upper_rad", own.upper_rad, spec.upper)
    for axis, low, high in zip((*spec.joints, "gripper"), lower, upper, strict=False):
        if not low < high:
            raise ConfigurationError(f"slave.limits.joints: leaves nothing of the range of {axis}")
    return lower, upper


def within(
    where: str, setting: float | tuple[float, ...] | None, own: Joints, narrow: Callable[..., float] = min
) -> Joints:
    """Limits of an arm, on each axis narrowed by a setting of the file."""
    return own if setting is None else tuple(map(narrow, own, each_axis(where, setting, len(own))))


def each_axis(where: str, setting: float | tuple[float, ...], count: int) -> Joints:
    try:
        return per_axis(setting, count)
    except ValueError as error:
        raise ConfigurationError(f"{where}: {error}") from None


def _joints(system: System) -> JointCodecSettings:
    assert system.codec.joints is not None
    return system.codec.joints


def _check(where: str, spec: ArmSpec, system: System) -> None:
    """An arm must have the axes of the file, and the wire must span its angles."""
    names, has_gripper = _joints(system).names, system.codec.gripper is not None
    if spec.joints != names:
        raise ConfigurationError(
            f"codec.joints.names: {', '.join(names)}; but {where} {spec.name} has {', '.join(spec.joints)}"
            + ("; map its axes with master.joint_mapping" if where == "master.device" else "; use these names")
        )
    if spec.gripper is not has_gripper:
        raise ConfigurationError(
            f"codec.gripper: {where} {spec.name} has {'a' if spec.gripper else 'no'} gripper; "
            + ("add gripper: {} under codec" if spec.gripper else "leave it out")
        )
    reach = max(map(abs, (*spec.lower, *spec.upper)))
    check_span("codec.joints.angle.step_rad", streams(system)[0][0], f"{where} reaches", reach, "rad")
