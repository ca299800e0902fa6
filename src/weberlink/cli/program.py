"""The program: its commands, put together."""

from importlib.metadata import entry_points, version
from typing import Annotated

import typer

from weberlink.cli import doctor, hardware, monitor, sessions, studies, visit
from weberlink.cli.arguments import OneLineErrors
from weberlink.compiled import is_compiled

GROUP = "weberlink.commands"
"""Entry points of other distributions: functions with typer annotations, each a command of its entry point's name."""

app = typer.Typer(
    name="weberlink",
    cls=OneLineErrors,
    help="Bilateral haptic teleoperation over UDP with perceptual coding.",
    invoke_without_command=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for module in (sessions, monitor, hardware, doctor, studies):
    for command in module.COMMANDS:
        app.command()(command)
app.command("try")(visit.visit)
app.add_typer(hardware.device)
for entry in entry_points(group=GROUP):
    app.command(entry.name)(entry.load())


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


def main() -> None:
    """Entry point of the program."""
    app(prog_name="weberlink")
