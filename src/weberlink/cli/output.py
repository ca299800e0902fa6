"""Output that commands share: errors, figures as text and JSON, a progress bar."""

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from weberlink.order import FAILED, MISCONFIGURED
from weberlink.registry import fault_of
from weberlink.session.targets import STANDARD_OUTPUT

if TYPE_CHECKING:
    from rich.console import Console

    from weberlink.session.report import Ended

PROGRESS_EVERY_S = 10.0  # least time between two lines about the progress of a command without a terminal [s]


class CommandError(Exception):
    """A command cannot do what it is asked for: one line that says why and, if known, what to do; exit status 1."""


@contextmanager
def errors(log: Callable[[Sequence[str]], None] = lambda _: None) -> Iterator[None]:
    """Report errors in one line: with status 2 a wrong file or key; with 1 what a command cannot do, a missing runtime
    directory, or a broken driver. `log` receives the trace of a driver, or of another part by name, that raised one.
    """
    try:
        yield
    except Exception as error:
        if was_interrupted(error) or isinstance(error, typer.Exit) or hasattr(error, "format_message"):  # of typer
            raise
        from weberlink.config.errors import ConfigurationError, trace_of  # noqa: PLC0415 - not for help
        from weberlink.protocol.keys import KeyFileError  # noqa: PLC0415
        from weberlink.telemetry.runtime_directory import RuntimeDirectoryError  # noqa: PLC0415

        if isinstance(error, CommandError | RuntimeDirectoryError):
            fail(str(error), FAILED)
        is_wrong_file, fault = isinstance(error, ConfigurationError | KeyFileError), fault_of(error)
        if not (is_wrong_file or (fault is not None and fault.is_foreign)):
            raise
        log(trace_of(error))
        if fault is not None and not is_wrong_file:
            fail(fault.text, FAILED)
        fail(str(error), MISCONFIGURED)


@contextmanager
def failing(kind: type[Exception], status: int = FAILED, prefix: str = "") -> Iterator[None]:
    """Report errors of this kind in one line."""
    try:
        yield
    except kind as error:
        fail(f"{prefix}{error}", status)


def was_interrupted(error: BaseException) -> bool:
    """Whether Ctrl-C is behind an error: Python 3.11 wraps it where it comes while a class is made, as in an import."""
    at: BaseException | None = error
    while at is not None and not isinstance(at, KeyboardInterrupt):
        at = at.__cause__ or at.__context__
    return at is not None


def tell(message: str) -> None:
    """Print one line on standard error."""
    typer.echo(f"weberlink: {message}", err=True)


def fail(message: str, status: int) -> NoReturn:
    """Print one line on standard error and exit."""
    tell(message)
    raise typer.Exit(status)


def write(document: dict[str, Any], out: Path | None, show: Callable[["Console"], None]) -> None:
    """Write JSON to `out`, and print the report unless JSON goes to standard output."""
    text = json.dumps(document, indent=2, allow_nan=False)
    if out == STANDARD_OUTPUT:
        sys.stdout.write(text + "\n")
        return
    if out is not None:
        try:
            out.write_text(text + "\n", encoding="utf-8")
        except OSError as error:
            sys.stderr.write(text + "\n")  # nothing is lost
            fail(f"{out}: cannot be written: {error.strerror}", FAILED)
    from rich.console import Console  # noqa: PLC0415 - not before there is something to print

    console = Console()
    fits = console.is_terminal and 80 <= console.width <= 100  # narrower, a table would cut its numbers
    show(console if fits else Console(width=80))


def attempt(write: Callable[[], object], where: Path) -> str | None:
    """Call `write`; returns the error message if the file cannot be written."""
    try:
        write()
    except OSError as error:
        return f"{where}: cannot be written: {error.strerror}"
    return None


def finish(
    ended: "Ended", title: str, json_out: Path | None, problem: str | None = None, *, quiet: bool = False
) -> NoReturn:
    """Print and write the report of a session, tell `problem`, and exit; `quiet` prints nothing."""
    write(ended.document, json_out, lambda console: None if quiet else ended.show(title, console))
    if problem is not None:
        fail(problem, ended.status or FAILED)
    raise typer.Exit(ended.status)


@contextmanager
def progress_bar() -> Iterator[Callable[..., None]]:
    """Show progress on standard error; yields `report(done, total, what)`."""
    from rich.console import Console  # noqa: PLC0415 - for long commands alone
    from rich.progress import (  # noqa: PLC0415
        BarColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True)
    columns = (BarColumn(), TextColumn("{task.description}"), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("starting", total=None)
        began = told = monotonic()

        def report(done: float, total: float, what: str = "") -> None:
            nonlocal told
            text, now = f"{done:g}/{total:g} {what}", monotonic()
            bar.update(task, completed=done, total=total, description=text)
            if bar.disable and now - told >= PROGRESS_EVERY_S:
                told = now
                tell(f"{text}, after {now - began:.0f} s")

        yield report
