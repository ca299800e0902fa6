"""Output that commands share: errors, figures as text and JSON, a progress bar."""

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, Protocol

import typer

from weberlink.system.order import COMPLETED, FAILED, MISCONFIGURED
from weberlink.telemetry.runtime_directory import RuntimeDirectoryError

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

STANDARD_OUTPUT = Path("-")


class Study(Protocol):
    """Results of a study command."""

    @property
    def document(self) -> dict[str, Any]: ...

    @property
    def table(self) -> "RenderableType": ...

    def draw(self, folder: Path) -> None: ...


@contextmanager
def errors() -> Iterator[None]:
    """Report a wrong file with status 2, a missing runtime directory with status 1; one line each."""
    from weberlink.system.configuration import ConfigurationError  # noqa: PLC0415 - not for the help

    try:
        yield
    except ConfigurationError as error:
        fail(str(error), MISCONFIGURED)
    except RuntimeDirectoryError as error:
        fail(str(error), FAILED)


def fail(message: str, status: int) -> NoReturn:
    """Print one line on standard error and exit."""
    typer.echo(f"weberlink: {message}", err=True)
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


def publish(study: Study, json_out: Path | None, plots: Path | None) -> None:
    """Print, write and draw the results of a study; a failure of one does not prevent the others."""
    failed = None
    try:
        write(study.document, json_out, lambda console: console.print(study.table))
    except typer.Exit as exit_:
        failed = exit_
    problem = None if plots is None else attempt(lambda: study.draw(plots), plots)
    if problem is not None:
        fail(problem, FAILED)
    if failed is not None:
        raise failed


def finish(
    summary: dict[str, Any], title: str, json_out: Path | None, problem: str | None = None, *, quiet: bool = False
) -> None:
    """Print and write the figures of a session, report `problem`, and exit; `quiet` prints nothing."""
    from weberlink.system.environment import environment  # noqa: PLC0415
    from weberlink.system.report import session_report  # noqa: PLC0415

    status = summary.pop("status", COMPLETED)
    summary["environment"] = environment()
    write(summary, json_out, lambda console: None if quiet else session_report(summary, title, console))
    if problem is not None:
        fail(problem, status or FAILED)
    raise typer.Exit(status)


@contextmanager
def progress_bar() -> Iterator[Callable[..., None]]:
    """Show progress on standard error if it is a terminal; yields `report(done, total, what)`."""
    from rich.console import Console  # noqa: PLC0415 - for long commands alone
    from rich.progress import (  # noqa: PLC0415
        BarColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    done_of = TextColumn("{task.completed}/{task.total} {task.description}")
    console = Console(stderr=True)
    columns = (BarColumn(), done_of, TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=None)

        def report(done: int, total: int, what: str = "") -> None:
            bar.update(task, completed=done, total=total, description=what)

        yield report
