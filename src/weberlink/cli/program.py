"""The program: its commands, put together."""

from collections.abc import Callable, Sequence
from importlib.metadata import version
from signal import SIG_DFL, SIGINT, default_int_handler, getsignal, signal
from typing import Annotated

import typer

from weberlink.cli import look, sessions, setup, try_session
from weberlink.cli.arguments import CommandGroup
from weberlink.compiled import is_compiled

TOPICS: dict[str, tuple[Callable[..., None] | typer.Typer, ...]] = {
    "Run": (try_session.try_session, sessions.loopback, sessions.master, sessions.slave, sessions.simulate),
    "Look": (look.monitor, look.check, look.doctor, look.record, look.bridge),
    "Setup": (setup.device, setup.keygen, setup.configs),
}
"""The commands and groups of commands, as the help lists them."""
NAMES: dict[Callable[..., None], str] = {try_session.try_session: "try"}
"""Names that Python reserves; the other commands have those of their functions."""


class Program(CommandGroup):
    """The commands of this program, and those of other distributions."""

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
for topic, commands in TOPICS.items():
    for command in commands:
        if isinstance(command, typer.Typer):
            app.add_typer(command, rich_help_panel=topic)
        else:
            app.command(NAMES.get(command), rich_help_panel=topic)(command)


@app.callback()
def program(
    context: typer.Context,
    show_version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Bilateral haptic teleoperation over UDP with perceptual coding."""
    if show_version:
        typer.echo(f"weberlink {version('weberlink')}{' (compiled)' if is_compiled() else ''}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point of the program; with arguments in place of those of the process."""
    if getsignal(SIGINT) is default_int_handler:
        signal(SIGINT, SIG_DFL)  # until a command begins, which has something to close or to keep
    app(arguments, prog_name="weberlink")
