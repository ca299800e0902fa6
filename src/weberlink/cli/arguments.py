"""Arguments that commands share, and one-line errors for wrong ones."""

import sys
from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from weberlink.system.order import COMPLETED, MISCONFIGURED

File = Annotated[Path, typer.Argument(metavar="FILE", help="Configuration of the system (YAML).")]
OptionalFile = Annotated[
    Path | None, typer.Argument(metavar="[FILE]", help="Configuration; by default one that needs no hardware.")
]
Set = Annotated[
    list[str] | None, typer.Option("--set", metavar="PATH.TO.KEY=VALUE", help="Override a key; may be repeated.")
]


def finite(value: float | None) -> float | None:
    """Refuse nan and inf, which the command line would parse."""
    if value is not None and not isfinite(value):
        raise typer.BadParameter(f"must be a finite number, not {value}")
    return value


Duration = Annotated[
    float | None,
    typer.Option("--duration", metavar="S", min=0.0, callback=finite, help="Length of the run [s]."),
]
Json = Annotated[
    Path | None, typer.Option("--json", metavar="OUT", help="Write the figures as JSON; - for standard output only.")
]

Record = Annotated[
    Path | None,
    typer.Option("--record", metavar="OUT", help="Record every tick as MCAP (extra: weberlink[recording])."),
]
Log = Annotated[
    Path | None,
    typer.Option("--log", metavar="OUT", help="Append events as JSON lines; - for standard output only."),
]
Plots = Annotated[Path | None, typer.Option("--plots", metavar="DIR", help="Draw figures (extra: weberlink[plots]).")]
Workers = Annotated[
    int | None, typer.Option("--workers", metavar="N", min=1, help="Number of processes; default: that of processors.")
]
Full = Annotated[bool, typer.Option("--full", help="Run the full, finer study; takes minutes.")]


class OneLineErrors(TyperGroup):
    """A command group that reports wrong arguments in one line."""

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
            # typer gives the class of usage errors no public name; `format_message` identifies them.
            format_message = getattr(error, "format_message", None)
            if format_message is None or not standalone_mode:
                raise
            sys.stderr.write(f"weberlink: {' '.join(format_message().split())}\n")
            sys.exit(MISCONFIGURED)
        if not standalone_mode:
            return result
        return sys.exit(result if isinstance(result, int) else COMPLETED)
