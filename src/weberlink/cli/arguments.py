"""Arguments that commands share, and the command group: help by topic, one-line errors, the answer to Ctrl-C."""

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from functools import cached_property
from math import isfinite
from pathlib import Path
from signal import SIG_DFL, SIGINT, SIGTERM, default_int_handler, getsignal, signal
from threading import current_thread, main_thread
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import typer
from typer.core import TyperGroup
from typer.main import get_command, get_group

from weberlink.cli.output import errors, fail, failing, was_interrupted
from weberlink.installation import absence, entries, guests, install_line
from weberlink.order import COMPLETED, INTERRUPTED, MISCONFIGURED
from weberlink.registry import resolve
from weberlink.session.targets import STANDARD_OUTPUT, TargetError, check_file, check_folder

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


def finite(value: float | None) -> float | None:
    """Refuse nan and inf, which the command line would parse."""
    if value is not None and not isfinite(value):
        raise typer.BadParameter(f"must be a finite number, not {value}")
    return value


def target(check: Callable[[Path], None], *, or_output: bool = False) -> Callable[..., Path | None]:
    """A callback that refuses what cannot be written, before anything is computed; "-" can be standard output."""

    def refuse(context: typer.Context, parameter: typer.CallbackParam, value: Path | None) -> Path | None:
        written = value is not None and not (or_output and value == STANDARD_OUTPUT)
        if written and not context.resilient_parsing:  # that of completion
            with failing(TargetError, MISCONFIGURED, f"{parameter.opts[0]}: "):
                check(value)  # type: ignore[arg-type]
        return value

    return refuse


file_target, json_target, folder_target = target(check_file), target(check_file, or_output=True), target(check_folder)

File = Annotated[Path, typer.Argument(metavar="FILE", help="Configuration of the system (YAML).")]
OptionalFile = Annotated[
    Path | None, typer.Argument(metavar="[FILE]", help="Configuration; by default one that needs no hardware.")
]
Set = Annotated[
    list[str] | None, typer.Option("--set", metavar="PATH.TO.KEY=VALUE", help="Override a key; may be repeated.")
]
Duration = Annotated[
    float | None, typer.Option("--duration", metavar="S", min=0.0, callback=finite, help="Length of the run [s].")
]
Json = Annotated[
    Path | None,
    typer.Option(
        "--json", metavar="OUT", callback=json_target, help="Write the figures as JSON; - for standard output only."
    ),
]
Record = Annotated[
    Path | None, typer.Option("--record", metavar="OUT", help="Record every tick as MCAP (weberlink-recording).")
]
Log = Annotated[
    Path | None, typer.Option("--log", metavar="OUT", help="Append events as JSON lines; - for standard output only.")
]
Listen = Annotated[
    str, typer.Option(metavar="ADDRESS", help="Address to serve; one that other hosts can reach needs --public.")
]
Public = Annotated[bool, typer.Option("--public", help="Allow other hosts, without encryption.")]
SessionName = Annotated[
    str | None, typer.Option("--session", metavar="ID", help="Follow one session only, by its launcher's process id.")
]


def check_public(listen: str, public: bool) -> None:
    """Refuse an address that other hosts can reach, unless that is asked for."""
    from weberlink.text import is_loopback  # noqa: PLC0415 - not for the help

    if not (public or is_loopback(listen)):
        fail(f"--listen {listen}: nothing is encrypted; add --public to serve other hosts all the same", MISCONFIGURED)


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


def _installed(entry: "EntryPoint") -> Any:
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
    return _command(entry.name, found, "Installed")


def _command(name: str, found: Any, topic: str) -> Any:
    """A command of a function, or a group of commands of a typer app."""
    alone = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    if isinstance(found, typer.Typer):
        alone.add_typer(found, name=name, rich_help_panel=topic)
        return get_group(alone).commands[name]
    alone.command(name, rich_help_panel=topic)(found)
    return get_command(alone)


class CommandGroup(TyperGroup):
    """A group of commands: help by topic, errors in one line, Ctrl-C in one line with status 130."""

    topics: ClassVar[Mapping[str, Mapping[str, str]]] = {}
    """By topic: functions with typer annotations, or typer apps, as "module:attribute", each a command, or a group of
    them, of its name. Only the one that is asked for is imported."""
    extended_by: str | None = None  # group of entry points of other distributions that add such commands

    @cached_property
    def _others(self) -> Mapping[str, "EntryPoint"]:
        return entries(self.extended_by)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in self.commands:
            for topic, places in self.topics.items():
                if cmd_name in places:
                    self.commands[cmd_name] = _command(cmd_name, resolve(places[cmd_name]), topic)
        if cmd_name not in self.commands and cmd_name in self._others:
            self.commands[cmd_name] = _installed(self._others[cmd_name])
        return super().get_command(ctx, cmd_name)

    def list_commands(self, ctx: Any) -> list[str]:
        own = [name for places in self.topics.values() for name in places]
        for name in (*own, *self._others):
            self.get_command(ctx, name)
        return [*dict.fromkeys((*own, *super().list_commands(ctx)))]

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """List the commands by topic, which is their `rich_help_panel`; without rich, whose import takes longer."""
        topics: dict[str, list[tuple[str, str]]] = {}
        names = self.list_commands(ctx)
        absent = {name: guest for name, guest in guests(self.extended_by).items() if name not in names}
        longest = max(map(len, (*names, *absent)))
        for name in names:
            command = self.commands[name]
            topic = getattr(command, "rich_help_panel", None) or "Commands"
            text = command.get_short_help_str(formatter.width - longest - 6)
            topics.setdefault(topic, []).append((name.ljust(longest), text))
        if absent:
            topics["Not installed"] = [(name.ljust(longest), install_line(guest)) for name, guest in absent.items()]
        for topic, rows in topics.items():
            with formatter.section(topic):
                formatter.write_dl(rows)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if self.get_command(ctx, args[0]) is None and not args[0].startswith("-"):
            guest = guests(self.extended_by).get(args[0])
            if guest is not None:
                ctx.fail(absence(f"the command {args[0]!r}", guest))
            ctx.fail(f"there is no command {args[0]!r}; {_known(args[0], self.list_commands(ctx))}")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        try:
            with interruptible(), errors():
                return super().invoke(ctx)
        except BaseException as error:
            if isinstance(error, typer.Exit) or not was_interrupted(error):
                raise
            fail("interrupted; nothing was kept", INTERRUPTED)  # of a command that has nothing to keep

    def main(self, *args: Any, standalone_mode: bool = True, **kwargs: Any) -> Any:
        try:
            result = super().main(*args, standalone_mode=False, **kwargs)  # type: ignore[misc]
        except Exception as error:
            # typer gives the class of usage errors no public name; `format_message` identifies them.
            format_message = getattr(error, "format_message", None)
            if format_message is None or not standalone_mode:
                raise
            text = format_message()  # that of a group without a command is its help
            sys.stderr.write(f"{text}\n" if text.startswith("Usage: ") else f"weberlink: {one_line(error, text)}\n")
            sys.exit(MISCONFIGURED)
        if not standalone_mode:
            return result
        return sys.exit(result if isinstance(result, int) else COMPLETED)


def one_line(error: Exception, text: str) -> str:
    """A usage error in one line; for an unknown option, with the options that there are."""
    context, name = getattr(error, "ctx", None), getattr(error, "option_name", None)
    if context is None or name is None:
        return " ".join(text.replace(": Input should", ": should").split())
    options = [option for parameter in context.command.get_params(context) for option in parameter.opts]
    command = context.command_path.removeprefix("weberlink").strip() or "weberlink"
    return f"{command} has no option {name}; {_known(name, [each for each in options if each.startswith('--')])}"


def _known(name: str, known: Sequence[str]) -> str:
    nearest = get_close_matches(name, known, n=1)
    return (f"did you mean {nearest[0]}? There are" if nearest else "there are") + f" {', '.join(known)}"
