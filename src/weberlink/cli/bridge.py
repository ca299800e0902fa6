"""The commands `bridge ros2` and `bridge foxglove`."""

from typing import Annotated

import typer

from weberlink.cli.arguments import CommandGroup
from weberlink.cli.output import errors

Session = Annotated[
    str | None,
    typer.Option(metavar="ID", help="Follow one session, by its launcher's process id; default: the newest."),
]

bridge = typer.Typer(
    name="bridge", cls=CommandGroup, help="Carry a running session to other systems.", no_args_is_help=True
)


@bridge.command()
def ros2(session: Session = None) -> None:
    """Publish a running session as ROS 2 topics, until Ctrl-C."""
    from weberlink.system.configuration.extras import need  # noqa: PLC0415 - each command imports what it needs

    with errors():
        for package in ("zenoh", "rosbags"):
            need(package, "ros2", "weberlink bridge ros2")
        from weberlink.apps.bridge.ros2 import run  # noqa: PLC0415

        run(session)


@bridge.command()
def foxglove(session: Session = None) -> None:
    """Show a running session in Foxglove, until Ctrl-C."""
    from weberlink.system.configuration.extras import need  # noqa: PLC0415

    with errors():
        need("foxglove", "foxglove", "weberlink bridge foxglove")
        from weberlink.apps.bridge.foxglove import run  # noqa: PLC0415

        run(session)
