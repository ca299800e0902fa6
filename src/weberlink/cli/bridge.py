"""The commands `bridge ros2` and `bridge foxglove`."""

from typing import Annotated

import typer

from weberlink.cli.arguments import CommandGroup, finite
from weberlink.cli.output import errors, fail
from weberlink.system.order import FAILED

Session = Annotated[
    str | None,
    typer.Option(metavar="ID", help="Follow one session, by its launcher's process id; default: the newest."),
]

bridge = typer.Typer(
    name="bridge", cls=CommandGroup, help="Carry a running session to other systems.", no_args_is_help=True
)


@bridge.command()
def ros2(
    session: Session = None,
    domain: Annotated[
        int, typer.Option(metavar="N", envvar="ROS_DOMAIN_ID", help="ROS domain, 0 to 232.", show_default=True)
    ] = 0,
    connect: Annotated[
        str | None,
        typer.Option(metavar="ENDPOINT", help="Zenoh router; default: tcp/localhost:7447, or none on this host."),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(
            metavar="HZ", min=0.1, callback=finite, help="Messages per second and topic; default: every tick."
        ),
    ] = None,
    depth: Annotated[int, typer.Option(metavar="N", min=1, help="Depth of the queues, as announced.")] = 10,
    best_effort: Annotated[
        bool, typer.Option("--best-effort", help="Announce the topics as best effort, not as reliable.")
    ] = False,
) -> None:
    """Publish a running session as ROS 2 topics, until Ctrl-C."""
    from weberlink.system.configuration.extras import need  # noqa: PLC0415 - each command imports what it needs

    with errors():
        for package in ("zenoh", "rosbags"):
            need(package, "ros2", "weberlink bridge ros2")
        from weberlink.apps.bridge.ros2 import run  # noqa: PLC0415
        from weberlink.ros2.names import Qos  # noqa: PLC0415
        from weberlink.ros2.node import NodeError  # noqa: PLC0415

        try:
            run(session, domain, connect, Qos(not best_effort, depth), rate)
        except NodeError as error:
            fail(f"bridge ros2: {error}", FAILED)


@bridge.command()
def foxglove(session: Session = None) -> None:
    """Show a running session in Foxglove, until Ctrl-C."""
    from weberlink.system.configuration.extras import need  # noqa: PLC0415

    with errors():
        need("foxglove", "foxglove", "weberlink bridge foxglove")
        from weberlink.apps.bridge.foxglove import run  # noqa: PLC0415

        run(session)
