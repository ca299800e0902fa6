"""The `monitor` command."""

from pathlib import Path
from typing import Annotated, Any

import typer

from weberlink.cli.arguments import MONITOR_PORT
from weberlink.cli.output import errors, fail
from weberlink.system.order import FAILED, MISCONFIGURED


def monitor(
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page; 0 for any free port.")] = MONITOR_PORT,
    listen: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Address of the page; one that other hosts can reach needs --public.")
    ] = "127.0.0.1",
    public: Annotated[
        bool,
        typer.Option("--public", help="Allow other hosts, without encryption; who has the key may change."),
    ] = False,
    session: Annotated[
        str | None, typer.Option(metavar="ID", help="Follow one session, by its launcher's process id; default: all.")
    ] = None,
    browse: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in a browser.")] = False,
    recordings: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder of the recordings that the page starts; made on first use.")
    ] = Path("recordings"),
    view: Annotated[
        str | None,
        typer.Option(metavar="SOURCE", help="Picture beside the scene: camera:/dev/video0 or robot."),
    ] = None,
) -> None:
    """Show running sessions in a browser.

    Until Ctrl-C. The same address has figures for Prometheus.
    """
    from weberlink.system.configuration.extras import need  # noqa: PLC0415 - each command imports what it needs

    with errors():
        for package in ("aiohttp", "prometheus_client"):
            need(package, "monitor", "weberlink monitor")
    from weberlink.apps.monitor import access  # noqa: PLC0415
    from weberlink.apps.monitor.address import MonitorError  # noqa: PLC0415
    from weberlink.apps.monitor.program import MonitorSettings, run, tell  # noqa: PLC0415

    if not access.is_loopback(listen):
        if not public:
            fail(
                f"--listen {listen}: the page is not encrypted; add --public to serve it to other hosts", MISCONFIGURED
            )
        tell(f"warning: {listen}: not encrypted, and everybody who can reach it sees everything")
    settings = MonitorSettings(
        listen,
        port,
        session,
        browse,
        recordings,
        None if view is None else _view(view),
    )
    try:
        run(settings)
    except MonitorError as error:
        fail(str(error), FAILED)


def _view(text: str) -> Any:
    """What --view shows."""
    from weberlink.apps.monitor.camera import ViewError, parse_view  # noqa: PLC0415
    from weberlink.system.configuration.extras import need  # noqa: PLC0415

    with errors():
        need("cv2", "camera", "--view")
    try:
        return parse_view(text)
    except ViewError as error:
        fail(str(error), MISCONFIGURED)
