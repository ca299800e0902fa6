"""A trial of a configuration before a run: every error of the file shows before a process is started."""

from weberlink.composition.link import build_security
from weberlink.composition.master import build_device
from weberlink.composition.slave import build_robot, workspace_of
from weberlink.configuration import Configuration, ConfigurationError
from weberlink.configuration.model import split_address


def try_out(configuration: Configuration) -> None:
    """Build what a run would build, and let go of it.

    Raises:
        ConfigurationError: as the builders do; or for a port that nobody could find, where one side runs alone.
    """
    build_security(configuration)
    if configuration.device is not None:
        build_device(configuration)
    if configuration.robot is not None:
        workspace_of(configuration, build_robot(configuration))
    alone = {"link.slave": configuration.robot is None, "link.listen": configuration.device is None}
    for field, is_alone in alone.items():
        address = getattr(configuration.system.link, field.partition(".")[2])
        if is_alone and split_address(address)[1] == 0:
            raise ConfigurationError(
                f"{configuration.path}: {field}: port 0 is for loopback; expected the port that both sides know"
            )
