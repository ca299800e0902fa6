"""Commands that set a host up: device, keygen, configs."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from weberlink.cli.arguments import CommandGroup, Json, file_target
from weberlink.cli.output import fail, failing, tell, write
from weberlink.order import MISCONFIGURED
from weberlink.session.targets import STANDARD_OUTPUT

device = typer.Typer(
    name="device", cls=CommandGroup, help="List, test or emulate devices and robots.", no_args_is_help=True
)
Options = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Set an option of the driver; may be repeated.")
]

# Each command imports what it needs when it runs.


@device.command("list")
def device_list(json_out: Json = None) -> None:
    """List drivers and plugged devices, and suggest fixes."""
    from weberlink.cli.devices import survey  # noqa: PLC0415

    found = survey()
    write(found.document, json_out, found.show)


@device.command("test")
def device_test(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Name of the driver; `weberlink device list` lists them.")
    ],
    config: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Configuration with options of the driver.")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Agree to force and motion in advance.")] = False,
    set_: Options = None,
) -> None:
    """Test a device step by step, at last with a gentle force.

    It shows the readings, checks signs without force and, after a yes, with a gentle force.
    """
    from weberlink.cli.device_test import DeviceTestError, Dialog, run  # noqa: PLC0415

    with failing(DeviceTestError):
        run(name, Dialog(sys.stdin, sys.stdout, yes=yes), config, set_ or ())


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
        Path | None, typer.Option(metavar="PATH", help="Path of the serial port; default: weberlink-NAME.")
    ] = None,
    faults: Annotated[Path | None, typer.Option(metavar="PATH", help="FIFO that fault commands are read from.")] = None,
    set_: Options = None,
) -> None:
    """Emulate a device, with faults on request, until Ctrl-C."""
    from weberlink.cli.emulate import run  # noqa: PLC0415

    out = sys.stderr if command else sys.stdout  # the command may use standard output itself
    raise typer.Exit(run(name, link, tuple(set_ or ()), tuple(command or ()), out=out, source=sys.stdin, faults=faults))


@device.command("rules")
def device_rules() -> None:
    """Install the udev rules, which give access without root."""
    from weberlink.cli import rules  # noqa: PLC0415

    with failing(rules.RulesError):
        typer.echo("\n".join(rules.install()))


def keygen(
    out: Annotated[
        Path, typer.Argument(metavar="OUT", callback=file_target, help="Where to write the key, with mode 0600.")
    ],
) -> None:
    """Write a new pre-shared key for one master and one slave."""
    from weberlink.protocol.keys import KeyFileError, generate  # noqa: PLC0415

    with failing(KeyFileError, MISCONFIGURED):
        generate(out)
    typer.echo(f"{out}: key written, readable by you alone; copy it to the other host over a channel you trust")


def configs(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="A shipped file to copy, or a folder of them; default: list.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Where to copy it; default: here; - for standard output.")
    ] = None,
) -> None:
    """List the shipped files; copy one, with the files it names."""
    from weberlink.cli.shipped import copy, listing, text_of  # noqa: PLC0415

    if name is None:
        if out is not None:
            fail("--out: is for one file: weberlink configs NAME --out FILE", MISCONFIGURED)
        write({}, None, listing().show)
    elif out == STANDARD_OUTPUT:
        typer.echo(text_of(name), nl=False)
    else:
        written = copy(name, out)
        typer.echo("\n".join(map(str, written))) if written else tell(f"{name}: is there already")
