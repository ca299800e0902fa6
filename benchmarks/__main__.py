"""`python -m benchmarks`, from a clone of the repository: real-time figures beside the limits of this machine."""

import sys
from importlib.resources import files
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.arrangement import BenchError
from benchmarks.study import run
from weberlink.cli.arguments import CommandGroup, Json, OptionalFile, Set, finite
from weberlink.cli.output import errors, fail, progress_bar
from weberlink.cli.sessions import one_host
from weberlink.order import FAILED
from weberlink_studies.commands import Plots, publish
from weberlink_studies.drawing import Footer, Format

# A group of one command has the one-line errors and the answer to Ctrl-C of `weberlink`.
app = typer.Typer(cls=CommandGroup, pretty_exceptions_enable=False, rich_markup_mode=None)
app.callback()(lambda: None)


@app.command()
def bench(
    file: OptionalFile = None,
    duration: Annotated[
        float | None,
        typer.Option(
            "--duration", metavar="S", min=1.0, callback=finite, help="Length of a live run [s]; default: 20."
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Measure everything briefly, in half a minute.")] = False,
    json_out: Json = None,
    plots: Plots = None,
    footer: Footer = True,
    format_: Format = None,
    set_: Set = None,
) -> None:
    """Measure real-time figures beside this machine's limits.

    Takes three minutes, or half a minute with --quick. Ctrl-C ends it with the parts so far.
    """
    path = file or Path(str(files("weberlink.configs") / "loopback.yaml"))
    try:
        with errors(), progress_bar() as progress:
            result = run(
                path, set_ or (), lambda overrides: one_host(path, overrides), duration=duration, quick=quick,
                plots=plots is not None, progress=progress,
            )  # fmt: skip
    except BenchError as error:
        fail(str(error), FAILED)
    publish(result, json_out, plots, footer=footer, formats=format_)


if __name__ == "__main__":
    app(["bench", *sys.argv[1:]], prog_name="python -m benchmarks")
