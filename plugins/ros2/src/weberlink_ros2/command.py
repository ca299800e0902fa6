"""The commands `weberlink bridge ros2` and `weberlink lead`."""

from typing import Annotated

import typer

from weberlink.cli.arguments import SessionName, finite
from weberlink.cli.output import failing


def ros2(
    session: SessionName = None,
    domain: Annotated[int, typer.Option(metavar="N", envvar="ROS_DOMAIN_ID", help="ROS domain, 0 to 232.")] = 0,
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
    from weberlink_ros2.bridge import run  # noqa: PLC0415 - not for the help
    from weberlink_ros2.names import Qos  # noqa: PLC0415
    from weberlink_ros2.node import NodeError  # noqa: PLC0415

    with failing(NodeError, prefix="bridge ros2: "):
        run(session, domain, connect, Qos(not best_effort, depth), rate)


def lead(session: SessionName = None) -> None:
    """Let the ROS 2 topic lead the hand of a session (driver: ros2), until Ctrl-C.

    One node leads for each time that this runs. When it has ended, or another one uses its name, run this again.
    """
    from weberlink_figures.watching.rings import NoSessionError  # noqa: PLC0415 - not for the help
    from weberlink_ros2.lead import lead as hold  # noqa: PLC0415

    with failing(NoSessionError, prefix="lead: "):
        hold(session)
