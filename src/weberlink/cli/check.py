"""The `check` command: the parts that a file composes, their cost on this machine, and advice as warnings.

The parts are built as the daemons build them; nothing is opened or sent.
"""

from collections.abc import Iterator
from time import perf_counter
from typing import TYPE_CHECKING, Any

from weberlink.codec import Channel
from weberlink.config import Configuration, System
from weberlink.control.table import SCHEMES
from weberlink.master.devices.contract import Device
from weberlink.protocol.wire import UpdateLayout
from weberlink.session.advice import advise, dry_run, measured_tick_s
from weberlink.session.composition.channels import streams
from weberlink.session.composition.link import build_security
from weberlink.slave.robots.contract import Robot

if TYPE_CHECKING:
    from weberlink.arms.contract import ArmSpec

UDP_IP_BYTES = 28


def describe(configuration: Configuration) -> Iterator[str]:
    """Describe a configuration, line by line; raises ConfigurationError if a part cannot be built as the file asks."""
    system, parts = configuration.system, dry_run(configuration)
    advice = advise(parts)
    tag = build_security(configuration).tag_size
    yield f"{configuration.path}: valid"
    if parts.is_of_arms:
        yield from _arms(system, parts.leader, parts.follower)
    else:
        yield from _hand_and_tool(system, parts.device, parts.robot)
    yield from _link(system)
    coded, octets = list(_streams(system)), 0
    carries_credit = not parts.is_of_arms and SCHEMES[system.control.scheme].carries_credit
    for title, name, settings, thresholds, channel in coded:
        layout = UpdateLayout(channel.forms, carries_credit=carries_credit, acks=len(coded) // 2)
        shortest, longest = (size + tag for size in layout.lengths)
        octets += shortest + UDP_IP_BYTES
        bank = f" of {', '.join(channel.bank)}" if len(channel.bank) > 1 else ""
        most = settings.max_updates_per_s
        at_most = "" if most is None else f"; at most {most:g} updates/s"
        yield f"{title:<10}{name}{settings.predictor}{bank}; {thresholds}{at_most}"
        yield f"          update of {shortest} to {longest} bytes of UDP payload"
    if (took := measured_tick_s(configuration)) is not None:
        yield f"cost      a tick of both sides takes {1e6 * took:.0f} us here, in virtual time"
    uncoded = octets * 8 * system.rate_hz / 1e3
    yield f"          an update every tick would be {uncoded:.0f} kbit/s both ways, IP headers included"
    for warning in advice:
        yield f"warning   {warning}"


# --- what is at the two ends, and between them


def _hand_and_tool(system: System, device: Device | None, robot: Robot | None) -> Iterator[str]:
    yield f"rate      {system.rate_hz:g} Hz, axes {system.axes}"
    if device is not None:
        # The smaller of the limits of the file and of the device.
        master, spec, scale = system.master, device.spec, system.master.frame_map.force_scale
        force = min(master.limits.force_n, spec.force_n * scale) if spec.force_feedback else 0.0
        torque = f", torque at most {min(master.limits.torque_nm, spec.torque_n_m * scale):g} N m"
        displayed = f"force at most {force:g} N{torque if system.codec.rotation is not None else ''}"
        yield f"master    device {master.device.driver}{_detail(device)}, {displayed}"
        if master.mapping is not None:
            mapping = master.mapping.model_dump(exclude_defaults=True, exclude={"walls"})
            mapped = [f"{name} {value}" for name, value in mapping.items()]
            if master.mapping.walls is not None:
                mapped.append(f"walls of {master.mapping.walls.stiffness_n_m:g} N/m")
            yield f"          mapped: {', '.join(mapped) or 'one to one'}"
    if robot is not None:
        if hasattr(robot, "measure_steps"):
            robot.measure_steps(perf_counter)  # as the daemon does
        silence = system.slave.limits.on_silence
        yield f"slave     robot {system.slave.robot.driver}{_detail(robot)}; on silence {silence}"
        absolute, relative = robot.spec.force_error
        if robot.spec.lag_s > 0.0:
            yield f"          readings lag by {1e3 * robot.spec.lag_s:.1f} ms, at {robot.spec.rate_hz:g} Hz"
        if absolute > 0.0 or relative > 0.0:
            yield f"          force known to +-({absolute:.2g} N + {100 * relative:.0f} %)"
    for thing in system.slave.scene:
        extras = [name for name in ("friction", "damping_n_s_m", "motion") if getattr(thing, name) is not None]
        with_extras = f" with {', '.join(extras)}" if extras else ""
        yield f"scene     {thing.shape}, {thing.stiffness_n_m:g} N/m{with_extras}"


def _detail(part: Device | Robot) -> str:
    """What a part says that it chose."""
    said = getattr(part, "description", str)()
    return f", {said}" if said else ""


def _arms(system: System, leader: "ArmSpec | None", follower: "ArmSpec | None") -> Iterator[str]:
    from weberlink.session.composition.arms import angle_limits, torque_limits  # noqa: PLC0415 - for arms alone

    joints = system.codec.joints
    assert joints is not None
    axes = f"{len(joints.names)} joints" + ("" if system.codec.gripper is None else " and a gripper")
    yield f"rate      {system.rate_hz:g} Hz, {axes}"
    if leader is not None:
        yield f"master    leader {system.master.device.driver}, {_bus(leader)}"
        yield f"          torque at most {_each(torque_limits(system, leader)[0])} N m"
    if follower is not None:
        yield f"slave     follower {system.slave.robot.driver}, {_bus(follower)}"
        lower, upper = angle_limits(system, follower)
        yield f"          angles from {_each(lower)}"
        yield f"          to {_each(upper)} rad"
        if follower.torque_error_nm > 0.0:
            yield f"          torque known to +-{follower.torque_error_nm:.2g} N m"


def _bus(spec: "ArmSpec") -> str:
    lag = f", readings lag by {1e3 * spec.lag_s:.1f} ms" if spec.lag_s > 0.0 else ""
    return f"{spec.name} at {spec.rate_hz:g} Hz{lag}"


def _each(setting: float | tuple[float, ...]) -> str:
    values = setting if isinstance(setting, tuple) else (setting,)
    return ", ".join(f"{value:.3g}" for value in (values if len(set(values)) > 1 else values[:1]))


def _link(system: System) -> Iterator[str]:
    link = system.link
    finder = link.finder
    yield f"link      {link.slave}, security {link.security}" if finder is None else f"link      by {finder.driver}"
    yield f"limits    {link.silence_ms:g} ms of silence, round trips up to {link.longest_round_trip_ms:g} ms"
    if link.playout_ms > 0.0:
        yield f"          every update is used {link.playout_ms:g} ms later than on its fastest way"
    if link.emulate is not None:
        changed = link.emulate.model_dump(exclude_defaults=True)
        yield f"          emulated: {', '.join(f'{name} {value}' for name, value in changed.items()) or 'no faults'}"
    control, turns = system.control, system.codec.rotation is not None
    yield f"control   {control.scheme}: {SCHEMES[control.scheme].does}"
    if control.scheme == "none":
        yield "          nothing bounds the energy"
    elif control.scheme == "bounded":
        most = f"{1e3 * control.allowance_j:g} mJ + {1e3 * control.refill_w:g} mW x time"
        yield f"          the hand gets at most {most} + {control.damping_n_s_m:g} N s/m x its squared speed,"
        yield f"          integrated, more than it gave, beside what the scene gives{'; as much by torques' * turns}"


# --- how the signals are coded


def _streams(system: System) -> Iterator[tuple[str, str, Any, str, Channel]]:
    """Of each coded signal: title and name of its line, its settings, its thresholds in words, and its channel."""
    codec, (forward, backward) = system.codec, streams(system)
    if codec.joints is None:
        force, shape = codec.force, backward[0].deadband.describe()
        thresholds = f"k = {force.weber:g}, floor {force.floor_n:g} N, reference {force.reference}"
        thresholds += "" if shape == "isotropic" else f"; {shape}"
        yield ("force", "", force, thresholds, backward[0])
        yield ("position", "", codec.position, f"bound {1e3 * codec.position.bound_m:g} mm", forward[0])
    if codec.rotation is not None:
        torque, turn = codec.rotation.torque, codec.rotation.orientation
        thresholds = f"k = {torque.weber:g}, floor {torque.floor_nm:g} N m, reference {torque.reference}"
        yield ("rotation", "torque ", torque, thresholds, backward[1])
        yield ("", "orientation ", turn, f"bound {turn.bound_rad:g} rad", forward[1])
    for (title, arm, _), angles, torques in zip(codec.arm, forward, backward, strict=False):
        yield (title, "angles ", arm.angle, f"bound {_each(arm.angle.bound_rad)} rad", angles)
        thresholds = f"k = {arm.torque.weber:g}, floor {_each(arm.torque.floor_nm)} N m"
        yield ("", "torques ", arm.torque, thresholds, torques)
