"""The program: its commands, put together."""

from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import EntryPoint, entry_points, version
from signal import SIG_DFL, SIGINT, default_int_handler, getsignal, signal
from typing import Annotated, Any

import typer
from typer.main import get_command, get_group

from weberlink.cli import look, sessions, setup, try_session
from weberlink.cli.arguments import CommandGroup
from weberlink.cli.output import fail
from weberlink.compiled import is_compiled
from weberlink.system.order import MISCONFIGURED

GROUP = "weberlink.commands"
"""Entry points of other distributions: functions with typer annotations, or typer apps, each a command, or a group of
them, of its entry point's name."""
INSTALLED: Mapping[str, EntryPoint] = {entry.name: entry for entry in entry_points(group=GROUP)}
TOPICS: dict[str, tuple[Callable[..., None] | typer.Typer, ...]] = {
    "Run": (try_session.try_session, sessions.loopback, sessions.master, sessions.slave, sessions.simulate),
    "Look": (look.monitor, look.check, look.doctor, look.bridge),
    "Setup": (setup.device, setup.peer, setup.keygen, setup.configs),
}
"""The commands and groups of commands, as the help lists them."""
NAMES: dict[Callable[..., None], str] = {try_session.try_session: "try"}
"""Names that Python reserves; the other commands have those of their functions."""


class Program(CommandGroup):
    """The commands of this program, and those of other distributions, which are loaded when they are asked for."""

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in self.commands and cmd_name in INSTALLED:
            self.commands[cmd_name] = installed(INSTALLED[cmd_name])
        return super().get_command(ctx, cmd_name)

    def list_commands(self, ctx: Any) -> list[str]:
        for name in INSTALLED:
            self.get_command(ctx, name)
        return super().list_commands(ctx)


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


def installed(entry: EntryPoint) -> Any:
    """The command, or group of commands, of another distribution; one that says why, if it cannot be loaded."""
    try:
        found = entry.load()
        problem = None if callable(found) else "it is not a function"
    except Exception as error:  # whatever it is, the other commands must work
        found, problem = None, f"{type(error).__name__}: {error}"
    if problem is not None:
        text = f"{entry.name}: the command of another distribution, {entry.value}, cannot be used: {problem}"

        def broken() -> None:
            """Cannot be used; run it to see why."""
            fail(" ".join(text.split()), MISCONFIGURED)

        found = broken
    alone = typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False)
    if isinstance(found, typer.Typer):
        alone.add_typer(found, name=entry.name, rich_help_panel="Installed")
        return get_group(alone).commands[entry.name]
    alone.command(entry.name, rich_help_panel="Installed")(found)
    return get_command(alone)


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
