"""Arguments that commands share, and the command group: help by topic, one-line errors, the answer to Ctrl-C."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from math import isfinite
from pathlib import Path
from signal import SIG_DFL, SIGINT, SIGTERM, default_int_handler, getsignal, signal
from threading import current_thread, main_thread
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from weberlink.cli.output import fail, was_interrupted
from weberlink.system.order import COMPLETED, INTERRUPTED, MISCONFIGURED
from weberlink.system.targets import STANDARD_OUTPUT, TargetError, check_file, check_folder

# Robots share their host with other tools, whose ports this one avoids: 8765 of Foxglove's bridge, which LeRobot starts
# too; 9090 of rosbridge and Prometheus; 9876 and 9877 of Rerun; 7000 of MeshCat; 5000, 5555, 8000, 8080, 8081 and 8888
# of web servers, notebooks and ZeroMQ. IANA assigns 8724 to nobody; Linux takes it for no outgoing connection.
MONITOR_PORT = 8724
"""Port of the live page where none is given."""

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


def file_target(context: typer.Context, parameter: typer.CallbackParam, value: Path | None) -> Path | None:
    """Refuse a file that cannot be written, before anything is computed."""
    return _target(context, parameter, value, check_file)


def json_target(context: typer.Context, parameter: typer.CallbackParam, value: Path | None) -> Path | None:
    """The same; "-" is standard output."""
    return value if value == STANDARD_OUTPUT else file_target(context, parameter, value)


def folder_target(context: typer.Context, parameter: typer.CallbackParam, value: Path | None) -> Path | None:
    """Refuse a folder in which nothing can be written, before anything is computed."""
    return _target(context, parameter, value, check_folder)


def _target(
    context: typer.Context, parameter: typer.CallbackParam, value: Path | None, check: Callable[[Path], None]
) -> Path | None:
    if value is not None and not context.resilient_parsing:  # that of completion
        try:
            check(value)
        except TargetError as error:
            fail(f"{parameter.opts[0]}: {error}", MISCONFIGURED)
    return value


Json = Annotated[
    Path | None,
    typer.Option(
        "--json", metavar="OUT", callback=json_target, help="Write the figures as JSON; - for standard output only."
    ),
]
Record = Annotated[
    Path | None,
    typer.Option("--record", metavar="OUT", help="Record every tick as MCAP (extra: weberlink[recording])."),
]
Log = Annotated[
    Path | None,
    typer.Option("--log", metavar="OUT", help="Append events as JSON lines; - for standard output only."),
]
Plots = Annotated[
    Path | None,
    typer.Option("--plots", metavar="DIR", callback=folder_target, help="Draw figures (extra: weberlink[studies])."),
]
Workers = Annotated[
    int | None, typer.Option("--workers", metavar="N", min=1, help="Number of processes; default: that of processors.")
]
Dask = Annotated[
    str | None,
    typer.Option("--dask", metavar="ADDRESS", help="Scheduler of a Dask cluster that works (extra: weberlink[dask])."),
]
Csv = Annotated[Path | None, typer.Option("--csv", metavar="OUT", callback=file_target, help="Write every row as CSV.")]
Full = Annotated[bool, typer.Option("--full", help="Run the full, finer study, which takes longer.")]


@contextmanager
def interruptible() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM alike raise KeyboardInterrupt, unless something handles or ignores them."""
    settable = (SIGINT, SIGTERM) if current_thread() is main_thread() else ()
    taken = [number for number in settable if getsignal(number) is SIG_DFL]
    try:
        for number in taken:
            signal(number, default_int_handler)
        yield
    finally:
        for number in taken:
            signal(number, SIG_DFL)


class CommandGroup(TyperGroup):
    """A group of commands: help by topic, wrong arguments in one line, Ctrl-C in one line with status 130."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002 - of the base class
        """List the commands by topic, which is their `rich_help_panel`; without rich, whose import takes longer."""
        topics: dict[str, list[tuple[str, str]]] = {}
        longest = max(map(len, self.commands))
        for name, command in self.commands.items():
            topic = getattr(command, "rich_help_panel", None) or "Commands"
            text = command.get_short_help_str(formatter.width - longest - 6)
            topics.setdefault(topic, []).append((name.ljust(longest), text))
        for topic, rows in topics.items():
            with formatter.section(topic):
                formatter.write_dl(rows)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args[0] not in self.commands and not args[0].startswith("-"):
            nearest = get_close_matches(args[0], self.commands, n=1)
            meant = f"did you mean {nearest[0]}? There are" if nearest else "there are"
            ctx.fail(f"there is no command {args[0]!r}; {meant} {', '.join(self.commands)}")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        try:
            with interruptible():
                return super().invoke(ctx)
        except BaseException as error:
            if isinstance(error, typer.Exit) or not was_interrupted(error):
                raise
            # Of a command that has nothing to keep.
            typer.echo("weberlink: interrupted; nothing was kept", err=True)
            raise typer.Exit(INTERRUPTED) from None

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
            sys.stderr.write(f"weberlink: {one_line(error, format_message)}\n")
            sys.exit(MISCONFIGURED)
        if not standalone_mode:
            return result
        return sys.exit(result if isinstance(result, int) else COMPLETED)


def one_line(error: Exception, format_message: Callable[[], str]) -> str:
    """A usage error in one line; for an unknown option, with the options that there are."""
    context, name = getattr(error, "ctx", None), getattr(error, "option_name", None)
    if context is None or name is None:
        return " ".join(format_message().replace(": Input should", ": should").split())
    known = [option for parameter in context.command.get_params(context) for option in parameter.opts]
    options = [option for option in known if option.startswith("--")]
    nearest = get_close_matches(name, options, n=1)
    meant = f"did you mean {nearest[0]}? There are" if nearest else "there are"
    command = context.command_path.removeprefix("weberlink").strip() or "weberlink"
    return f"{command} has no option {name}; {meant} {', '.join(options)}"
