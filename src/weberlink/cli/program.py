"""The program: its commands, put together."""

from collections.abc import Sequence
from signal import SIG_DFL, SIGINT, default_int_handler, getsignal, signal
from typing import Annotated, ClassVar

import typer

from weberlink.cli.arguments import CommandGroup
from weberlink.compiled import build, is_compiled

_HERE = "weberlink.cli"


class Program(CommandGroup):
    """The commands of this program, and those of other distributions."""

    topics: ClassVar = {
        "Run": {name: f"{_HERE}.sessions:{name}" for name in ("loopback", "master", "slave", "remote", "simulate")}
        | {"stop": f"{_HERE}.commands:stop"},
        "Look": {name: f"{_HERE}.commands:{name}" for name in ("check", "bridge")},
        "Setup": {name: f"{_HERE}.commands:{name}" for name in ("device", "guardian", "keygen", "configs")},
    }
    extended_by = "weberlink.commands"


app = typer.Typer(
    name="weberlink",
    cls=Program,
    help="Bilateral haptic teleoperation over UDP with perceptual coding.",
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


@app.callback()
def program(
    context: typer.Context,
    show_version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Bilateral haptic teleoperation over UDP with perceptual coding."""
    if show_version:
        from importlib.metadata import version  # noqa: PLC0415 - as long an import as all of ours

        typer.echo(f"weberlink {version('weberlink')}, {build(compiled=is_compiled())}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point of the program; with arguments in place of those of the process."""
    if getsignal(SIGINT) is default_int_handler:
        signal(SIGINT, SIG_DFL)  # until a command begins, which has something to close or to keep
    app(arguments, prog_name="weberlink")
