"""Commands that show a session, a file or a machine: check, doctor, bridge."""

from contextlib import nullcontext
from pathlib import Path
from textwrap import wrap
from typing import Annotated, Literal

import typer

from weberlink.cli.arguments import CommandGroup, File, Json, Set
from weberlink.cli.output import fail, write
from weberlink.order import COMPLETED, FAILED, MASTER, MISCONFIGURED, SIDES


class Bridges(CommandGroup):
    """Those of other distributions."""

    extended_by = "weberlink.bridges"


bridge = typer.Typer(name="bridge", cls=Bridges, help="Carry a running session to other systems.", no_args_is_help=True)

# Each command imports what it needs when it runs.


def check(file: File, set_: Set = None) -> None:
    """Validate FILE; print its parts, their cost and warnings."""
    from weberlink.cli.check import describe  # noqa: PLC0415
    from weberlink.config import load  # noqa: PLC0415

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
            help="Measure the link to the waiting slave instead, and name settings that suit it: of a known peer where "
            "link.finder finds a path, else of HOST or HOST:PORT. No device is opened, and the robot does not move.",
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

    from weberlink.cli.doctor import Grade, Needs, examine  # noqa: PLC0415
    from weberlink.config import load  # noqa: PLC0415

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
        from weberlink.cli.doctor.link import examine_link, towards  # noqa: PLC0415

        overrides = towards(link, load(file, overrides, [MASTER]), overrides)
        configuration = load(file, overrides, [MASTER])
        with waiting:
            found = examine_link(configuration, overrides, seconds)
    write(found.document, json_out, found.show)
    raise typer.Exit(FAILED if found.count(Grade.PROBLEM) else COMPLETED)
