"""A trial of a configuration before a run: every error of the file shows before a process is started."""

from collections.abc import Iterator

from weberlink.control.contract import MasterControl, SlaveControl
from weberlink.control.table import SCHEMES
from weberlink.master.devices.contract import Device
from weberlink.registry import check_contract, import_part
from weberlink.slave.robots.contract import Robot
from weberlink.system.composition.bounds import beyond
from weberlink.system.composition.link import build_security, construct, located
from weberlink.system.composition.master import build_device
from weberlink.system.composition.slave import build_robot, workspace_of
from weberlink.system.configuration import Configuration, ConfigurationError, System
from weberlink.system.configuration.model import split_address


def try_out(configuration: Configuration) -> list[str]:
    """Build what a run would build, and let go of it.

    Returns:
        What a person should know before the run.

    Raises:
        ConfigurationError: as the builders do; or for a port that nobody could find, or a key that nobody else has,
            where one side runs alone.
    """
    build_security(configuration)
    _check_scheme(configuration)
    found = _notes(configuration)
    alone = {"link.slave": configuration.robot is None, "link.listen": configuration.device is None}
    for field, is_alone in alone.items():
        address = getattr(configuration.system.link, field.partition(".")[2])
        if is_alone and split_address(address)[1] == 0:
            raise ConfigurationError(
                f"{configuration.path}: {field}: port 0 is for loopback; expected the port that both sides know"
            )
    if configuration.system.link.security == "session" and any(alone.values()):
        raise ConfigurationError(
            f"{configuration.path}: link.security: session is for weberlink loopback, which runs both sides; "
            "for one side write psk, with key_file (weberlink keygen KEYFILE)"
        )
    return found


def _notes(configuration: Configuration) -> list[str]:
    if configuration.system.codec.joints is not None:
        return list(_of_arms(configuration))
    device = robot = None
    if configuration.device is not None:
        device = build_device(configuration)
    if configuration.robot is not None:
        robot = build_robot(configuration)
        workspace_of(configuration, robot)
    return [*lacks(configuration.system, device, robot), *beyond(configuration, device, robot)]


def _of_arms(configuration: Configuration) -> Iterator[str]:
    if configuration.device is not None:
        from weberlink.system.composition.leading import build_leader, leader_notes  # noqa: PLC0415 - for arms alone

        yield from leader_notes(build_leader(configuration).spec)
    if configuration.robot is not None:
        from weberlink.system.composition.following import build_follower, follower_notes  # noqa: PLC0415 - likewise

        yield from follower_notes(configuration.system, build_follower(configuration).spec)


@located
def _check_scheme(configuration: Configuration) -> None:
    """See that the control scheme can be imported and has its methods, where another distribution brings it."""
    name = configuration.system.control.scheme
    if name in SCHEMES.built_in:
        return
    scheme, what = construct("control.scheme", SCHEMES.load, name), f"control scheme {SCHEMES.owned(name)}"
    for place, contract in ((scheme.master, MasterControl), (scheme.slave, SlaveControl)):
        made = construct("control.scheme", import_part, what, place)
        construct("control.scheme", check_contract, what, made, contract)


def lacks(system: System, device: Device | None, robot: Robot | None) -> Iterator[str]:
    """Capabilities without which nothing is felt, and what the drivers want a person to know before a run."""
    if device is not None:
        if device.spec.push_n > 0.0:
            yield (
                f"master.device: {device.spec.name} has no force feedback; the force resists its rate, and a full "
                f"deflection holds {device.spec.push_n:g} N"
            )
        elif not device.spec.force_feedback:
            yield f"master.device: {device.spec.name} has no force feedback; nothing is felt"
        if system.codec.rotation is not None and device.spec.torque_n_m == 0.0:
            yield f"master.device: {device.spec.name} has no torque feedback; it turns the tool and feels no torque"
        if device.spec.note:
            yield f"master.device: {device.spec.note}"
    if robot is not None:
        if not robot.spec.force_sensing:
            yield f"slave.robot: {robot.spec.name} senses no force; nothing is felt"
        if robot.spec.note:
            yield f"slave.robot: {robot.spec.note}"
