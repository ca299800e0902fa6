"""The commands `bridge ros2` and `bridge foxglove`."""

from typing import Annotated

import typer

from weberlink.cli.arguments import CommandGroup
from weberlink.cli.output import errors, fail
from weberlink.system.order import FAILED, MISCONFIGURED

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
def foxglove(
    session: Session = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the server; 0 for any free port.")] = 8765,
    listen: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Address to serve; one that other hosts can reach needs --public.")
    ] = "127.0.0.1",
    public: Annotated[
        bool, typer.Option("--public", help="Allow other hosts, without encryption or authentication.")
    ] = False,
    allow_changes: Annotated[
        bool, typer.Option("--allow-changes", help="Let every client set parameters: deadband, predictor, link.")
    ] = False,
) -> None:
    """Show a running session in Foxglove, until Ctrl-C."""
    from weberlink.system.configuration.extras import need  # noqa: PLC0415

    with errors():
        need("foxglove", "foxglove", "weberlink bridge foxglove")
    from weberlink.apps.bridge.foxglove import run  # noqa: PLC0415
    from weberlink.apps.monitor.access import is_loopback  # noqa: PLC0415
    from weberlink.apps.monitor.address import MonitorError  # noqa: PLC0415

    if not is_loopback(listen) and not public:
        fail(
            f"--listen {listen}: the server is neither encrypted nor authenticated; "
            "add --public to serve it to other hosts all the same",
            MISCONFIGURED,
        )
    try:
        run(session, listen, port, allow_changes=allow_changes)
    except MonitorError as error:
        fail(str(error), FAILED)
