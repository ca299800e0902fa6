"""What every command shares: complaints, figures on paper and in JSON, a bar of progress. Knows no command."""

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn, Protocol

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from weberlink.system.configuration import ConfigurationError
from weberlink.system.daemon import COMPLETED, FAILED, MISCONFIGURED
from weberlink.telemetry.runtime_directory import RuntimeDirectoryError


class Study(Protocol):
    """What a study command found, and how it is shown."""

    @property
    def document(self) -> dict[str, Any]: ...

    @property
    def table(self) -> Table: ...

    def draw(self, folder: Path) -> None: ...


@contextmanager
def errors() -> Iterator[None]:
    """A wrong file is one line and exit status 2; a host without a runtime directory is one line and status 1."""
    try:
        yield
    except ConfigurationError as error:
        fail(str(error), MISCONFIGURED)
    except RuntimeDirectoryError as error:
        fail(str(error), FAILED)


def fail(message: str, status: int) -> NoReturn:
    """One line on standard error, and the end."""
    typer.echo(f"weberlink: {message}", err=True)
    raise typer.Exit(status)


def write(document: dict[str, Any], out: Path | None, show: Callable[[Console], None]) -> None:
    """JSON where it was asked for; the report for people unless standard output is taken."""
    text = json.dumps(document, indent=2, allow_nan=False)
    if out is not None and str(out) == "-":
        sys.stdout.write(text + "\n")
        return
    if out is not None:
        try:
            out.write_text(text + "\n", encoding="utf-8")
        except OSError as error:
            sys.stderr.write(text + "\n")  # nothing is lost
            fail(f"{out}: cannot be written: {error.strerror}", FAILED)
    console = Console()
    fits = console.is_terminal and 80 <= console.width <= 100  # narrower, a table would cut its numbers
    show(console if fits else Console(width=80))


def attempt(write: Callable[[], object], where: Path) -> str | None:
    """Write what can be written beside the figures; returns the complaint, for after them."""
    try:
        write()
    except OSError as error:
        return f"{where}: cannot be written: {error.strerror}"
    return None


def publish(study: Study, json_out: Path | None, plots: Path | None) -> None:
    """Write and print what a study found, and draw it: what goes wrong with the one takes nothing of the other."""
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
    """Print and write the figures of a session, then what else went wrong, and exit; nothing is printed if `quiet`."""
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
    """A bar on standard error where a person watches; told how many of how many pieces are done, and what is next."""
    done_of = TextColumn("{task.completed}/{task.total} {task.description}")
    console = Console(stderr=True)
    columns = (BarColumn(), done_of, TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=None)

        def report(done: int, total: int, what: str = "") -> None:
            bar.update(task, completed=done, total=total, description=what)

        yield report
