"""Commands that stop sessions, look at a file (check) or carry a session on (bridge), and set a host up (device,
keygen, configs).

Each imports what it needs when it runs.
"""

import os
from math import inf
from pathlib import Path
from textwrap import wrap
from time import monotonic, sleep
from typing import Annotated, Literal

import typer

from weberlink.cli.arguments import CommandGroup, File, Json, Set, file_target
from weberlink.cli.output import fail, tell, write
from weberlink.order import FAILED, INTERRUPTED, MISCONFIGURED
from weberlink.session.targets import STANDARD_OUTPUT

LOOK_S, TELL_S = 0.002, 0.5  # of a stop: time between two looks for an answer, and until it is said that there is none


class Bridges(CommandGroup):
    """Those of other distributions."""

    extended_by = "weberlink.bridges"


bridge = typer.Typer(name="bridge", cls=Bridges, help="Carry a running session to other systems.", no_args_is_help=True)


def stop(
    session: Annotated[
        str | None, typer.Argument(metavar="[SESSION]", help="The launcher's process id; default: all of this user.")
    ] = None,
) -> None:
    """Stop sessions of this host at once: no force, no motion.

    Repeated until every side has acknowledged it. Not in order: the runs have failed.
    """
    from weberlink.session.emergency import EmergencyStop, Scope  # noqa: PLC0415

    order = EmergencyStop(Scope(session=session), None, monotonic())
    tell_at = order.at + TELL_S
    try:
        while not order.advance(monotonic()):
            if monotonic() > tell_at:
                tell(f"not stopped yet: {order.answer()['why']}; asked again until Ctrl-C")
                tell_at = inf
            sleep(LOOK_S)
    except KeyboardInterrupt:
        fail(f"NOT stopped: {order.answer()['why']}", INTERRUPTED)
    answer = order.answer()
    if not answer["accepted"]:
        fail(answer["why"], FAILED)
    typer.echo(f"stopped: {', '.join(answer['sessions'])}")


def check(file: File, set_: Set = None) -> None:
    """Validate FILE; print its parts, their cost and warnings."""
    from weberlink.cli.check import describe  # noqa: PLC0415
    from weberlink.config import load  # noqa: PLC0415

    for line in list(describe(load(file, set_ or ()))):
        typer.echo(
            "\n".join(wrap(line, 80, subsequent_indent=" " * 10, break_long_words=False, break_on_hyphens=False))
        )


class Devices(CommandGroup):
    """The commands on devices, with those of other distributions."""

    extended_by = "weberlink.device_commands"


device = typer.Typer(name="device", cls=Devices, help="List, test or emulate devices and robots.", no_args_is_help=True)


@device.command("list")
def device_list(json_out: Json = None) -> None:
    """List drivers and plugged devices, and suggest fixes."""
    from weberlink.cli.devices import survey  # noqa: PLC0415

    found = survey()
    write(found.document, json_out, found.show)


@device.command("rules")
def device_rules() -> None:
    """Install the udev rules, which give access without root."""
    from weberlink.cli.rules import install  # noqa: PLC0415

    typer.echo(install())


def guardian(
    socket: Annotated[Path, typer.Argument(metavar="[SOCKET]", help="Where sessions find it.")] = Path(
        "/run/weberlink-guardian/socket"
    ),
) -> None:
    """Take the force off devices whose session dies, until a signal.

    A service that outlives sessions, containers and their control groups. Sessions use SOCKET where it is there; with
    $WEBERLINK_GUARDIAN, that one alone.
    """
    from weberlink.child_process import isolated_python  # noqa: PLC0415
    from weberlink.hardware import guardian_process  # noqa: PLC0415

    command = isolated_python(guardian_process.__file__, "serve", str(socket))
    os.execv(command[0], command)  # noqa: S606 - our own, and all that it needs is the standard library


def keygen(
    out: Annotated[
        Path, typer.Argument(metavar="OUT", callback=file_target, help="Where to write the key, with mode 0600.")
    ],
    right: Annotated[
        Literal["drive", "watch", "stop"], typer.Option("--right", help="What it is good for; drive: for all three.")
    ] = "drive",
    name: Annotated[
        str, typer.Option("--name", metavar="NAME", help="Of the host that holds it; no other name can use it then.")
    ] = "",
) -> None:
    """Write a new pre-shared key for one host and one slave."""
    from weberlink.protocol.keys import Right, generate  # noqa: PLC0415

    generate(out, Right(right), name)
    typer.echo(f"{out}: key written, readable by you alone; copy it to the other host over a channel you trust")
    if name:
        typer.echo(f"the robot's host may hold several: add this line to its key file, for {name} to {right}")


def configs(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="A shipped file to copy, or a folder of them; default: list.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Where to copy it; default: here; - for standard output.")
    ] = None,
) -> None:
    """List the shipped files; copy one, with the files it names."""
    from weberlink.cli.shipped import copy, show, text_of  # noqa: PLC0415

    if name is None:
        if out is not None:
            fail("--out: is for one file: weberlink configs NAME --out FILE", MISCONFIGURED)
        write({}, None, show)
    elif out == STANDARD_OUTPUT:
        typer.echo(text_of(name), nl=False)
    else:
        written = copy(name, out)
        typer.echo("\n".join(map(str, written))) if written else tell(f"{name}: is there already")
