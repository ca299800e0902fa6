"""The `doctor` command."""

from contextlib import nullcontext
from typing import Annotated, Literal

import typer

from weberlink.cli.arguments import Json, OptionalFile, Set
from weberlink.cli.output import errors, fail, write
from weberlink.system.order import COMPLETED, FAILED, MISCONFIGURED, SIDES

Side = Annotated[
    Literal["master", "slave"] | None, typer.Option("--side", help="Check what this side needs; default: both.")
]


def doctor(
    file: OptionalFile = None,
    side: Side = None,
    json_out: Json = None,
    set_: Set = None,
) -> None:
    """Check this machine for real time, and suggest fixes.

    With FILE, it checks what that needs. Takes some seconds.
    """
    from weberlink.apps.doctor import Grade, Needs, examine  # noqa: PLC0415 - each command imports what it needs
    from weberlink.system.configuration import load  # noqa: PLC0415

    if file is None and set_:
        fail("--set: needs a FILE", MISCONFIGURED)
    sides = SIDES if side is None else (side,)
    with errors():
        needs = Needs(sides=sides) if file is None else Needs.of(load(file, set_ or (), sides), sides)
    from rich.console import Console  # noqa: PLC0415 - slow import

    console = Console(stderr=True)
    with console.status("measuring for some seconds") if console.is_terminal else nullcontext():
        found = examine(needs)
    write(found.document, json_out, found.show)
    raise typer.Exit(FAILED if found.count(Grade.PROBLEM) else COMPLETED)
