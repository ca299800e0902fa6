"""The command `weberlink bridge foxglove`."""

from typing import Annotated

import typer

from weberlink.cli.arguments import Listen, Public, SessionName, check_public
from weberlink.cli.output import failing


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
    check_public(listen, public)
    from weberlink_foxglove.bridge import ServeError, run  # noqa: PLC0415 - not for the help

    with failing(ServeError):
        run(session, listen, port, allow_changes=allow_changes)
