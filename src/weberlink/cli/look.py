"""Commands that show a session, a file or a machine: monitor, check, doctor, bridge."""

from contextlib import nullcontext
from pathlib import Path
from textwrap import wrap
from typing import Annotated, Literal

import typer

from weberlink.cli.arguments import (
    MONITOR_PORT,
    Browse,
    CommandGroup,
    File,
    Json,
    Listen,
    Port,
    Public,
    SessionName,
    Set,
    check_public,
    finite,
)
from weberlink.cli.output import fail, failing, tell, write
from weberlink.system.order import COMPLETED, FAILED, MASTER, MISCONFIGURED, SIDES

bridge = typer.Typer(
    name="bridge", cls=CommandGroup, help="Carry a running session to other systems.", no_args_is_help=True
)

# Each command imports what it needs when it runs.


def monitor(
    port: Port = None,
    listen: Listen = "127.0.0.1",
    public: Public = False,
    session: SessionName = None,
    browse: Browse = False,
    recordings: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder of the recordings that the page starts; made on first use.")
    ] = Path("recordings"),
    view: Annotated[
        str | None, typer.Option(metavar="SOURCE", help="Picture beside the scene: camera:/dev/video0 or robot.")
    ] = None,
) -> None:
    """Show running sessions in a browser.

    Until Ctrl-C. The same address has figures for Prometheus.
    """
    from weberlink.system.configuration.extras import need  # noqa: PLC0415

    for package in ("aiohttp", "prometheus_client"):
        need(package, "monitor", "weberlink monitor")
    from weberlink.apps.monitor.access import is_loopback  # noqa: PLC0415
    from weberlink.apps.monitor.address import MonitorError  # noqa: PLC0415
    from weberlink.apps.monitor.camera import ViewError, parse_view  # noqa: PLC0415
    from weberlink.apps.monitor.program import MonitorSettings, run  # noqa: PLC0415

    check_public(listen, public)
    if not is_loopback(listen):
        tell(f"warning: {listen}: not encrypted, and everybody who can reach it sees everything")
    if view is not None:
        need("cv2", "camera", "--view")
    with failing(ViewError, MISCONFIGURED):
        shown = None if view is None else parse_view(view)
    with failing(MonitorError):
        run(MonitorSettings(listen, MONITOR_PORT if port is None else port, session, browse, recordings, shown))


def check(file: File, set_: Set = None) -> None:
    """Validate FILE; print its parts, their cost and warnings."""
    from weberlink.system.check import describe  # noqa: PLC0415
    from weberlink.system.configuration import load  # noqa: PLC0415

    for line in list(describe(load(file, set_ or ()))):
        typer.echo(
            "\n".join(wrap(line, 80, subsequent_indent=" " * 10, break_long_words=False, break_on_hyphens=False))
        )


def doctor(
    file: Annotated[
        Path | None, typer.Argument(metavar="[FILE]", help="Configuration whose needs are checked; default: the usual.")
    ] = None,
    side: Annotated[
        Literal["master", "slave"] | None, typer.Option("--side", help="Check what this side needs; default: both.")
    ] = None,
    link: Annotated[
        str | None,
        typer.Option(
            "--link",
            metavar="PEER|HOST",
            help="Measure the link to the waiting slave instead, and name settings that suit it: of a known peer with "
            "link.path ice, else of HOST or HOST:PORT. No device is opened, and the robot does not move.",
        ),
    ] = None,
    seconds: Annotated[
        float, typer.Option("--duration", metavar="S", min=1.0, max=600.0, help="Of the measurement of the link [s].")
    ] = 10.0,
    json_out: Json = None,
    set_: Set = None,
) -> None:
    """Check this machine, or the link to the robot.

    For real time, with FILE for what that needs; or with --link the link. Suggests fixes, takes some seconds.
    """
    from rich.console import Console  # noqa: PLC0415

    from weberlink.apps.doctor import Grade, Needs, examine  # noqa: PLC0415
    from weberlink.system.configuration import load  # noqa: PLC0415

    overrides, sides = set_ or [], SIDES if side is None else (side,)
    if file is None and (link is not None or overrides):
        fail(f"{'--set' if link is None else '--link'}: needs a FILE", MISCONFIGURED)
    console = Console(stderr=True)
    waiting = console.status("measuring for some seconds") if console.is_terminal else nullcontext()
    if link is None or file is None:
        needs = Needs(sides=sides) if file is None else Needs.of(load(file, overrides, sides), sides)
        with waiting:
            found = examine(needs)
    else:
        from weberlink.apps.doctor.link_report import examine_link, towards  # noqa: PLC0415

        overrides = towards(link, load(file, overrides, [MASTER]).system.link, overrides)
        configuration = load(file, overrides, [MASTER])
        with waiting:
            found = examine_link(configuration, overrides, seconds)
    write(found.document, json_out, found.show)
    raise typer.Exit(FAILED if found.count(Grade.PROBLEM) else COMPLETED)


@bridge.command()
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
    from weberlink.system.configuration.extras import need  # noqa: PLC0415

    for package in ("zenoh", "rosbags"):
        need(package, "ros2", "weberlink bridge ros2")
    from weberlink.apps.bridge.ros2 import run  # noqa: PLC0415
    from weberlink.ros2.names import Qos  # noqa: PLC0415
    from weberlink.ros2.node import NodeError  # noqa: PLC0415

    with failing(NodeError, prefix="bridge ros2: "):
        run(session, domain, connect, Qos(not best_effort, depth), rate)


@bridge.command()
def foxglove(
    session: SessionName = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the server; 0 for any free port.")] = 8765,
    listen: Listen = "127.0.0.1",
    public: Public = False,
    allow_changes: Annotated[
        bool, typer.Option("--allow-changes", help="Let every client set parameters: deadband, predictor, link.")
    ] = False,
) -> None:
    """Show a running session in Foxglove, until Ctrl-C."""
    from weberlink.system.configuration.extras import need  # noqa: PLC0415

    for package in ("foxglove", "rosbags"):
        need(package, "foxglove", "weberlink bridge foxglove")
    from weberlink.apps.bridge.foxglove import run  # noqa: PLC0415
    from weberlink.apps.monitor.address import MonitorError  # noqa: PLC0415

    check_public(listen, public)
    with failing(MonitorError):
        run(session, listen, port, allow_changes=allow_changes)
