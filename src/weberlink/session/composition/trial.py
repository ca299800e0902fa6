"""A trial of a configuration before a run: every error of the file shows before a process is started."""

from weberlink.config import Configuration, ConfigurationError
from weberlink.config.model import split_address
from weberlink.control.contract import MasterControl, SlaveControl
from weberlink.control.table import SCHEMES
from weberlink.registry import check_contract, import_part
from weberlink.session.advice import Parts
from weberlink.session.composition.link import build_security, construct, located
from weberlink.session.composition.master import build_device
from weberlink.session.composition.slave import build_robot, workspace_of


def try_out(configuration: Configuration) -> Parts:
    """Build what a run would build, and let go of it.

    Returns:
        What was built, for `weberlink.session.advice`.

    Raises:
        ConfigurationError: as the builders do; or for a port that nobody could find, or a key that nobody else has,
            where one side runs alone.
    """
    build_security(configuration)
    _check_scheme(configuration)
    parts = _build_parts(configuration)
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
    return parts


def _build_parts(configuration: Configuration) -> Parts:
    if configuration.system.codec.joints is not None:
        return _arms(configuration)
    device = robot = None
    if configuration.device is not None:
        device = build_device(configuration)
    if configuration.robot is not None:
        robot = build_robot(configuration)
        workspace_of(configuration, robot)
    return Parts(configuration, device, robot)


def _arms(configuration: Configuration) -> Parts:
    leader = follower = None
    if configuration.device is not None:
        from weberlink.session.composition.leading import build_leader  # noqa: PLC0415 - for arms alone

        leader = build_leader(configuration).spec
    if configuration.robot is not None:
        from weberlink.session.composition.following import build_follower  # noqa: PLC0415 - likewise

        follower = build_follower(configuration).spec
    return Parts(configuration, leader=leader, follower=follower)


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
