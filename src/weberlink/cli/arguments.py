"""The arguments that commands share, and how they complain of wrong ones. Knows no command."""

import sys
from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from weberlink.system.daemon import COMPLETED, MISCONFIGURED

File = Annotated[Path, typer.Argument(metavar="FILE", help="Configuration of the system (YAML).")]
OptionalFile = Annotated[
    Path | None, typer.Argument(metavar="[FILE]", help="Configuration; without it, a default that needs nothing.")
]
Set = Annotated[
    list[str] | None, typer.Option("--set", metavar="PATH.TO.KEY=VALUE", help="Override a key; may be repeated.")
]


def finite(value: float | None) -> float | None:
    """A number of the command line, which parses "nan" and "inf" too."""
    if value is not None and not isfinite(value):
        raise typer.BadParameter(f"must be a finite number, not {value}")
    return value


Duration = Annotated[
    float | None,
    typer.Option("--duration", metavar="S", min=0.0, callback=finite, help="Length of the run [s]."),
]
Json = Annotated[
    Path | None, typer.Option("--json", metavar="OUT", help="Write the figures as JSON; - for standard output, alone.")
]

Record = Annotated[
    Path | None,
    typer.Option("--record", metavar="OUT", help="Record every tick as MCAP (extra: weberlink[recording])."),
]
Log = Annotated[
    Path | None,
    typer.Option(
        "--log", metavar="OUT", help="Append what happens, a JSON object a line; - for standard output, alone."
    ),
]
Plots = Annotated[Path | None, typer.Option("--plots", metavar="DIR", help="Draw figures (extra: weberlink[plots]).")]
Workers = Annotated[
    int | None, typer.Option("--workers", metavar="N", min=1, help="Processes; as many as processors if not given.")
]
Full = Annotated[bool, typer.Option("--full", help="All of it, finer, in minutes.")]


class OneLineErrors(TyperGroup):
    """Commands whose complaints about arguments are one line, as those about files are."""

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,
    ) -> Any:
        try:
            result = super().main(args, prog_name, complete_var, False, windows_expand_args, **extra)
        except Exception as error:
            # The class of such errors has no public name; what tells it is that it can put itself in words.
            in_words = getattr(error, "format_message", None)
            if in_words is None or not standalone_mode:
                raise
            sys.stderr.write(f"weberlink: {' '.join(in_words().split())}\n")
            sys.exit(MISCONFIGURED)
        if not standalone_mode:
            return result
        return sys.exit(result if isinstance(result, int) else COMPLETED)
