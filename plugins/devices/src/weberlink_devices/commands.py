"""The command `device emulate`."""

import sys
from pathlib import Path
from typing import Annotated

import typer


def emulate(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Driver of the device to emulate.")],
    command: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[-- COMMAND...]", help="Command to run meanwhile; {port} is the port. HID devices need one."
        ),
    ] = None,
    link: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Path of the serial port; default: weberlink-NAME.")
    ] = None,
    faults: Annotated[Path | None, typer.Option(metavar="PATH", help="FIFO that fault commands are read from.")] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Set an option of the driver; may be repeated."),
    ] = None,
) -> None:
    """Emulate a device, with faults on request, until Ctrl-C."""
    from weberlink_devices.emulation import run  # noqa: PLC0415

    out = sys.stderr if command else sys.stdout  # the command may use standard output itself
    raise typer.Exit(run(name, link, tuple(set_ or ()), tuple(command or ()), out=out, source=sys.stdin, faults=faults))
