"""The `configs` command."""

from pathlib import Path
from typing import Annotated

import typer

from weberlink.cli.output import errors, fail, tell, write
from weberlink.system.order import MISCONFIGURED
from weberlink.system.targets import STANDARD_OUTPUT


def configs(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="A shipped file to copy, or a folder of them; default: list.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Where to copy it; default: here; - for standard output."),
    ] = None,
) -> None:
    """List the shipped files; copy one, with the files it names."""
    from weberlink.apps.shipped import copy, listing, text_of  # noqa: PLC0415 - each command imports what it needs

    if name is None:
        if out is not None:
            fail("--out: is for one file: weberlink configs NAME --out FILE", MISCONFIGURED)
        write({}, None, listing().show)
        return
    with errors():
        if out == STANDARD_OUTPUT:
            typer.echo(text_of(name), nl=False)
            return
        written = copy(name, out)
    for path in written:
        typer.echo(path)
    if not written:
        tell(f"{name}: is there already")
