"""The command `watch`: the pictures of a robot that another host drives."""

from weberlink.cli.arguments import Duration, File, Set
from weberlink.cli.output import CommandError
from weberlink.cli.sessions import PeerLabel, acquainted
from weberlink.order import MASTER


def watch(file: File, duration: Duration = None, peer: PeerLabel = None, set_: Set = None) -> None:
    """Watch a robot that another host drives.

    Until Ctrl-C; weberlink monitor on this host shows the pictures. The key of this host must be good for it (weberlink
    keygen --right watch). FILE is the operator's; no device is opened.
    """
    import asyncio  # noqa: PLC0415 - not for the help

    from weberlink.config import ConfigurationError, load  # noqa: PLC0415
    from weberlink_video.watch import watch_pictures  # noqa: PLC0415

    overrides = [*(set_ or ()), *acquainted(file, set_ or (), MASTER, peer, pairs=False)]
    configuration = load(file, overrides, sides=())
    if configuration.cameras is None:
        raise ConfigurationError(f"{file}: slave.cameras: there are none to watch; name the robot's")
    if (why := asyncio.run(watch_pictures(configuration, duration))) is not None:
        raise CommandError(why)
