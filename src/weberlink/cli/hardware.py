"""Commands for what is plugged in: what there is, whether it works, and its stand-in."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from weberlink.cli.arguments import Json, OneLineErrors
from weberlink.cli.output import errors, fail, write
from weberlink.system.daemon import FAILED

Options = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Set an option of it; may be repeated.")
]

device = typer.Typer(
    name="device", cls=OneLineErrors, help="Look at one device or robot by itself.", no_args_is_help=True
)


def devices(
    install_rules: Annotated[
        bool, typer.Option("--install-rules", help="Install the shipped udev rules first; needs root.")
    ] = False,
    json_out: Json = None,
) -> None:
    """Say which drivers there are, what is plugged in, and what helps where something is in the way."""
    from weberlink.apps import rules  # noqa: PLC0415
    from weberlink.apps.devices import survey  # noqa: PLC0415

    if install_rules:
        try:
            typer.echo("\n".join(rules.install()), err=True)
        except rules.RulesError as error:
            fail(str(error), FAILED)
    found = survey()
    write(found.document, json_out, found.show)


@device.command("test")
def device_test(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Of the driver; `weberlink devices` lists them.")],
    config: Annotated[
        Path | None, typer.Option("--config", metavar="FILE", help="A configuration that has its options.")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Agree to force and motion beforehand.")] = False,
    set_: Options = None,
) -> None:
    """Show what it measures, check its signs without force, then, after a yes, gently with force."""
    from weberlink.apps.device_test import DeviceTestError, Dialog, Request, run  # noqa: PLC0415

    try:
        with errors():
            run(Request(name, config, tuple(set_ or ())), Dialog(sys.stdin, sys.stdout, yes=yes))
    except DeviceTestError as error:
        fail(str(error), FAILED)


def emulate(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Of the driver that is to talk to it.")],
    command: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[-- COMMAND...]", help="Run beside it; {port} stands for the port. A HID device needs one."
        ),
    ] = None,
    link: Annotated[
        Path | None, typer.Option("--link", metavar="PATH", help="Of the serial port; weberlink-NAME if not given.")
    ] = None,
    faults: Annotated[
        Path | None, typer.Option("--faults", metavar="PATH", help="A FIFO for lines that say what goes wrong.")
    ] = None,
    set_: Options = None,
) -> None:
    """Be the device at the other end of the wire, faults included, until Ctrl-C."""
    from weberlink.apps.emulate import run  # noqa: PLC0415

    # A command beside it may want standard output for itself.
    out = sys.stderr if command else sys.stdout
    with errors():
        status = run(name, link, tuple(set_ or ()), tuple(command or ()), out=out, source=sys.stdin, faults=faults)
    raise typer.Exit(status)


COMMANDS = (devices, emulate)
