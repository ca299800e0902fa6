"""The program: its commands, put together."""

import typer

from weberlink.cli import hardware, monitor, operation, sessions, studies
from weberlink.cli.arguments import OneLineErrors

app = typer.Typer(
    name="weberlink",
    cls=OneLineErrors,
    help="Bilateral haptic teleoperation over UDP with perceptual coding.",
    invoke_without_command=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for command in (
    *sessions.COMMANDS,
    *monitor.COMMANDS,
    *hardware.COMMANDS,
    *operation.COMMANDS,
    *studies.COMMANDS,
):
    app.command()(command)
app.add_typer(hardware.device)


@app.callback()
def program(context: typer.Context) -> None:
    """Bilateral haptic teleoperation over UDP with perceptual coding."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def main() -> None:
    """Entry point of the program."""
    app(prog_name="weberlink")
