"""The lines of `weberlink check` for a session in joint space."""

from collections.abc import Iterable, Iterator

from weberlink.arms.contract import ArmSpec
from weberlink.codec import Channel
from weberlink.config import Configuration, System
from weberlink.config.joints import AngleCodecSettings, JointTorqueCodecSettings
from weberlink.control.table import SCHEMES
from weberlink.geometry.joints import Joints
from weberlink.protocol.wire import UpdateLayout
from weberlink.session.composition.channels import streams
from weberlink.session.composition.following import angle_limits, build_follower
from weberlink.session.composition.leading import build_leader, torque_limits

UDP_IP_BYTES = 28


def arms(configuration: Configuration, tag: int, link: Iterable[str]) -> Iterator[str]:
    """Describe both arms, the link and the coding, line by line.

    Args:
        configuration: with `codec.joints`.
        tag: size of the tag of a datagram [bytes].
        link: lines of the link.

    Raises:
        ConfigurationError: a part cannot be built as the file asks.
    """
    system = configuration.system
    joints, gripper = system.codec.joints, system.codec.gripper
    assert joints is not None
    axes = f"{len(joints.names)} joints" + (" and a gripper" if gripper is not None else "")
    yield f"rate      {system.rate_hz:g} Hz, {axes}"
    if configuration.device is not None:
        spec = build_leader(configuration).spec
        yield f"master    leader {system.master.device.driver}, {_bus(spec)}"
        yield f"          torque at most {_list(torque_limits(system, spec)[0])} N m"
    if configuration.robot is not None:
        spec = build_follower(configuration).spec
        yield f"slave     follower {system.slave.robot.driver}, {_bus(spec)}"
        lower, upper = angle_limits(system, spec)
        yield f"          angles from {_list(lower)}"
        yield f"          to {_list(upper)} rad"
        if spec.torque_error_nm > 0.0:
            yield f"          torque known to +-{spec.torque_error_nm:.2g} N m"
    yield from link
    forward, backward = streams(system)
    yield from _coding("joints", joints.angle, joints.torque, (forward[0], backward[0]), tag, system)
    if gripper is not None:
        yield from _coding("gripper", gripper.angle, gripper.torque, (forward[1], backward[1]), tag, system)
    octets = sum(_lengths(channel, system)[0] + tag + UDP_IP_BYTES for channel in (*forward, *backward))
    uncoded = octets * 8 * system.rate_hz / 1e3
    yield f"          an update every tick would be {uncoded:.0f} kbit/s both ways, IP headers included"


def _coding(
    name: str,
    angle: AngleCodecSettings,
    torque: JointTorqueCodecSettings,
    channels: tuple[Channel, Channel],
    tag: int,
    system: System,
) -> Iterator[str]:
    forward, backward = (f"{low + tag} to {high + tag}" for low, high in (_lengths(each, system) for each in channels))
    yield f"{name:<10}angles {angle.predictor}; bound {_setting(angle.bound_rad)} rad{_most(angle)}"
    yield f"          update of {forward} bytes of UDP payload"
    floor = f"floor {_setting(torque.floor_nm)} N m"
    yield f"          torques {torque.predictor}; k = {torque.weber:g}, {floor}{_most(torque)}"
    yield f"          update of {backward} bytes of UDP payload"


def _most(settings: AngleCodecSettings | JointTorqueCodecSettings) -> str:
    most = settings.max_updates_per_s
    return "" if most is None else f"; at most {most:g} updates/s"


def _lengths(channel: Channel, system: System) -> tuple[int, int]:
    layout = UpdateLayout(
        channel.forms,
        carries_credit=SCHEMES[system.control.scheme].carries_credit,
        acks=1 if system.codec.gripper is None else 2,
    )
    return layout.lengths


def _bus(spec: ArmSpec) -> str:
    lag = f", readings lag by {1e3 * spec.lag_s:.1f} ms" if spec.lag_s > 0.0 else ""
    return f"{spec.name} at {spec.rate_hz:g} Hz{lag}"


def _list(values: Joints) -> str:
    return _setting(values[0] if len(set(values)) == 1 else values)


def _setting(setting: float | tuple[float, ...]) -> str:
    return ", ".join(f"{value:.3g}" for value in setting) if isinstance(setting, tuple) else f"{setting:.3g}"
