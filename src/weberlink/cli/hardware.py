"""The commands `device list`, `device test`, `device emulate` and `device rules`."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from weberlink.cli.arguments import CommandGroup, Json
from weberlink.cli.output import errors, fail, write
from weberlink.system.order import FAILED

Options = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Set an option of the driver; may be repeated.")
]

device = typer.Typer(
    name="device", cls=CommandGroup, help="List, test or emulate devices and robots.", no_args_is_help=True
)


@device.command("list")
def device_list(json_out: Json = None) -> None:
    """List drivers and plugged devices, and suggest fixes."""
    from weberlink.apps.devices import survey  # noqa: PLC0415 - each command imports what it needs

    found = survey()
    write(found.document, json_out, found.show)


@device.command("test")
def device_test(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Name of the driver; `weberlink device list` lists them.")
    ],
    config: Annotated[
        Path | None, typer.Option("--config", metavar="FILE", help="Configuration with options of the driver.")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Agree to force and motion in advance.")] = False,
    set_: Options = None,
) -> None:
    """Test a device step by step, at last with a gentle force.

    It shows the readings, checks signs without force and, after a yes, with a gentle force.
    """
    from weberlink.apps.device_test import DeviceTestError, DeviceTestRequest, Dialog, run  # noqa: PLC0415

    try:
        with errors():
            run(DeviceTestRequest(name, config, tuple(set_ or ())), Dialog(sys.stdin, sys.stdout, yes=yes))
    except DeviceTestError as error:
        fail(str(error), FAILED)


@device.command()
def emulate(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Driver of the device to emulate.")],
    command: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[-- COMMAND...]", help="Command to run meanwhile; {port} is the port. HID devices need one."
        ),
    ] = None,
    link: Annotated[
        Path | None, typer.Option("--link", metavar="PATH", help="Path of the serial port; default: weberlink-NAME.")
    ] = None,
    faults: Annotated[
        Path | None, typer.Option("--faults", metavar="PATH", help="FIFO that fault commands are read from.")
    ] = None,
    set_: Options = None,
) -> None:
    """Emulate a device, with faults on request, until Ctrl-C."""
    from weberlink.apps.emulate import run  # noqa: PLC0415

    # The command may use standard output itself.
    out = sys.stderr if command else sys.stdout
    with errors():
        status = run(name, link, tuple(set_ or ()), tuple(command or ()), out=out, source=sys.stdin, faults=faults)
    raise typer.Exit(status)


@device.command("rules")
def device_rules() -> None:
    """Install the udev rules, which give access without root."""
    from weberlink.apps import rules  # noqa: PLC0415

    try:
        typer.echo("\n".join(rules.install()))
    except rules.RulesError as error:
        fail(str(error), FAILED)
