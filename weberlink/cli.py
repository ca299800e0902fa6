"""The command line. Owns arguments, exit statuses and what is printed; every command's work is elsewhere.

Exit status: 0 done, 1 the run failed, 2 the file or the arguments are wrong (one line on standard error).
"""

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Protocol

import typer
from rich.console import Console
from rich.live import Live
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from weberlink.arguments import Duration, File, Full, Json, OneLineErrors, OptionalFile, Plots, Set, finite
from weberlink.configuration import MASTER, SIDES, SLAVE, ConfigurationError, load
from weberlink.daemon import COMPLETED, FAILED, MISCONFIGURED


class Study(Protocol):
    """What a study command found, and how it is shown."""

    @property
    def document(self) -> dict[str, Any]: ...

    @property
    def table(self) -> Table: ...

    def draw(self, folder: Path) -> None: ...


app = typer.Typer(
    name="weberlink",
    cls=OneLineErrors,
    help="Bilateral haptic teleoperation over UDP with perceptual coding.",
    invoke_without_command=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


@app.callback()
def program(context: typer.Context) -> None:
    """Bilateral haptic teleoperation over UDP with perceptual coding."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@app.command()
def loopback(file: OptionalFile = None, duration: Duration = None, json_out: Json = None, set_: Set = None) -> None:
    """Run master and slave as two processes over UDP on 127.0.0.1."""
    path = file or Path(str(files("configs") / "loopback.yaml"))
    overrides = [*(set_ or ()), *_free_port(path, set_ or ())]
    _live("loopback", path, overrides, SIDES, duration, json_out)


@app.command()
def master(file: File, duration: Duration = None, json_out: Json = None, set_: Set = None) -> None:
    """Run the operator's side."""
    _live("master", file, set_ or (), [MASTER], duration, json_out)


@app.command()
def slave(file: File, duration: Duration = None, json_out: Json = None, set_: Set = None) -> None:
    """Run the teleoperator's side."""
    _live("slave", file, set_ or (), [SLAVE], duration, json_out)


@app.command()
def check(file: File, set_: Set = None) -> None:
    """Validate a file, and print what it composes and what that costs."""
    from weberlink.check import describe  # noqa: PLC0415 - each command imports what it needs

    with _errors():
        lines = list(describe(load(file, set_ or ())))
    typer.echo("\n".join(lines))


@app.command()
def keygen(out: Annotated[Path, typer.Argument(metavar="OUT", help="Where to write the key, with mode 0600.")]) -> None:
    """Write a new pre-shared key."""
    from protocol.keys import KeyFileError, generate  # noqa: PLC0415

    try:
        generate(out)
    except KeyFileError as error:
        _fail(str(error), MISCONFIGURED)
    typer.echo(f"{out}: key written, readable by you alone; copy it to the other host over a channel you trust")


@app.command()
def simulate(
    file: File,
    duration: Duration = None,
    json_out: Json = None,
    trace: Annotated[
        Path | None, typer.Option(metavar="OUT", help="Write what the robot was commanded and felt, as a trace (CSV).")
    ] = None,
    set_: Set = None,
) -> None:
    """Run the whole system in virtual time, as fast as it goes."""
    from weberlink.simulate import simulate as run  # noqa: PLC0415

    with _errors():
        summary, recorder = run(load(file, set_ or ()), duration)
    problem = None if trace is None else _attempt(lambda: recorder.save(trace), trace)
    _finish(summary, f"weberlink simulate {file}", json_out, problem)


@app.command()
def evaluate(
    traces: Annotated[list[Path], typer.Argument(metavar="TRACE...", help="Recorded signals (CSV).")],
    predictor: Annotated[str, typer.Option(metavar="P,..", help="Predictors.")] = "zoh,linear,plane,sphere,hybrid",
    weber: Annotated[str, typer.Option(metavar="K,..", help="Weber factors.")] = "0.10",
    floor: Annotated[float, typer.Option(metavar="N", min=0.0, callback=finite, help="Absolute threshold [N].")] = 0.02,
    wire: Annotated[bool, typer.Option("--wire/--no-wire", help="Quantize and saturate as on the wire.")] = True,
    json_out: Json = None,
    plots: Plots = None,
) -> None:
    """Run recorded signals through the codec."""
    from weberlink.evaluate import run  # noqa: PLC0415

    with _errors():
        result = run(traces, predictor, weber, floor, wire=wire, plots=plots is not None)
    _publish(result, json_out, plots)


@app.command()
def precision(full: Full = False, json_out: Json = None, plots: Plots = None) -> None:
    """Put error beside run time: integrators of stiff contact, and the codec."""
    from weberlink.precision import run  # noqa: PLC0415

    with _errors(), _progress() as progress:
        result = run(full=full, plots=plots is not None, progress=lambda what, done, total: progress(done, total, what))
    _publish(result, json_out, plots)


@app.command()
def stability(
    full: Full = False,
    workers: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Processes; as many as processors if not given.")
    ] = None,
    json_out: Json = None,
    plots: Plots = None,
) -> None:
    """Map which stiff and extreme cases stay bounded, and what energy they make."""
    from weberlink.stability import run  # noqa: PLC0415

    with _errors(), _progress() as progress:
        result = run(full=full, plots=plots is not None, workers=workers, progress=progress)
    _publish(result, json_out, plots)


def main() -> None:
    """Entry point of the program."""
    app(prog_name="weberlink")


def _live(
    name: str, path: Path, overrides: list[str] | tuple[()], sides: Any, duration: float | None, json_out: Path | None
) -> None:
    from weberlink.composition.trial import try_out  # noqa: PLC0415
    from weberlink.launcher import Session  # noqa: PLC0415
    from weberlink.report import status_line  # noqa: PLC0415

    with _errors():
        configuration = load(path, overrides, sides)
        try_out(configuration)
    console = Console(stderr=True)
    with Live(Text("starting"), console=console, refresh_per_second=10, transient=True) as live:

        def watch(records: dict[str, Any], summary: dict[str, Any]) -> None:
            live.update(Text(status_line(records, summary)))

        watcher = watch if console.is_terminal else None
        with Session(configuration, overrides, sides, duration, watcher) as session:
            summary = session.run()
    _finish(summary, f"weberlink {name}", json_out)


def _finish(summary: dict[str, Any], title: str, json_out: Path | None, problem: str | None = None) -> None:
    """Print and write the figures of a session, then what else went wrong, and exit."""
    from evaluation.environment import environment  # noqa: PLC0415
    from weberlink.report import session_report  # noqa: PLC0415

    status = summary.pop("status", COMPLETED)
    summary["environment"] = environment()
    _write(summary, json_out, lambda console: session_report(summary, title, console))
    if problem is not None:
        _fail(problem, status or FAILED)
    raise typer.Exit(status)


def _publish(study: Study, json_out: Path | None, plots: Path | None) -> None:
    """Write and print what a study found, then draw it: what goes wrong with a figure takes no number with it."""
    _write(study.document, json_out, lambda console: console.print(study.table))
    problem = None if plots is None else _attempt(lambda: study.draw(plots), plots)
    if problem is not None:
        _fail(problem, FAILED)


@contextmanager
def _progress() -> Iterator[Callable[..., None]]:
    """A bar on standard error where a person watches; told how many of how many pieces are done, and what is next."""
    done_of = TextColumn("{task.completed}/{task.total} {task.description}")
    console = Console(stderr=True)
    columns = (BarColumn(), done_of, TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=None)

        def report(done: int, total: int, what: str = "") -> None:
            bar.update(task, completed=done, total=total, description=what)

        yield report


def _attempt(write: Callable[[], object], where: Path) -> str | None:
    """Write what can be written beside the figures; returns the complaint, for after them."""
    try:
        write()
    except OSError as error:
        return f"{where}: cannot be written: {error.strerror}"
    return None


def _write(document: dict[str, Any], out: Path | None, show: Callable[[Console], None]) -> None:
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
            _fail(f"{out}: cannot be written: {error.strerror}", FAILED)
    console = Console()
    show(Console(width=80) if not console.is_terminal or console.width > 100 else console)


@contextmanager
def _errors() -> Iterator[None]:
    try:
        yield
    except ConfigurationError as error:
        _fail(str(error), MISCONFIGURED)


def _fail(message: str, status: int) -> None:
    typer.echo(f"weberlink: {message}", err=True)
    raise typer.Exit(status)


def _free_port(path: Path, overrides: list[str] | tuple[()]) -> list[str]:
    """Overrides that replace port 0 by one that is free now, so that several loopbacks can run at once."""
    import socket  # noqa: PLC0415

    from weberlink.configuration.model import split_address  # noqa: PLC0415

    with _errors():
        link = load(path, overrides).system.link
    host, port = split_address(link.listen)
    if port != 0:
        return []
    is_v6 = ":" in host
    with socket.socket(socket.AF_INET6 if is_v6 else socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((host, 0))
        port = probe.getsockname()[1]
    address = json.dumps(f"[{host}]:{port}" if is_v6 else f"{host}:{port}")  # quoted, for YAML
    return [f"link.listen={address}", f"link.slave={address}"]
