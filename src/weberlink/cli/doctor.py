"""The `doctor` command."""

from contextlib import nullcontext
from typing import Annotated, Literal

import typer

from weberlink.cli.arguments import Json, OptionalFile, Set
from weberlink.cli.output import errors, fail, write
from weberlink.system.order import COMPLETED, FAILED, MASTER, MISCONFIGURED, SIDES

Side = Annotated[
    Literal["master", "slave"] | None, typer.Option("--side", help="Check what this side needs; default: both.")
]


Link = Annotated[
    str | None,
    typer.Option(
        "--link",
        metavar="PEER|HOST",
        help="Measure the link to the waiting slave instead, and name settings that suit it: of a known peer with "
        "link.path ice, else of HOST or HOST:PORT. No device is opened, and the robot does not move.",
    ),
]
Seconds = Annotated[
    float, typer.Option("--duration", metavar="S", min=1.0, max=600.0, help="Of the measurement of the link [s].")
]


def doctor(
    file: OptionalFile = None,
    side: Side = None,
    link: Link = None,
    seconds: Seconds = 10.0,
    json_out: Json = None,
    set_: Set = None,
) -> None:
    """Check this machine, or the link to the robot.

    For real time, with FILE for what that needs; or with --link the link. Suggests fixes, takes some seconds.
    """
    # Each command imports what it needs; rich is slow to import.
    from rich.console import Console  # noqa: PLC0415

    from weberlink.apps.doctor import Grade, Needs, examine  # noqa: PLC0415
    from weberlink.system.configuration import load  # noqa: PLC0415

    overrides, sides = set_ or [], SIDES if side is None else (side,)
    if file is None and (link is not None or overrides):
        fail(f"{'--set' if link is None else '--link'}: needs a FILE", MISCONFIGURED)
    console = Console(stderr=True)
    waiting = console.status("measuring for some seconds") if console.is_terminal else nullcontext()
    with errors():
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
