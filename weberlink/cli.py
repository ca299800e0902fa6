"""The command line. Owns arguments, exit statuses and what is printed; every command's work is elsewhere.

Exit status: 0 done, 1 the run failed, 2 the file or the arguments are wrong (one line on standard error).
"""

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Protocol

import typer
from rich.console import Console
from rich.live import Live
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from weberlink.arguments import (
    Duration,
    File,
    Full,
    Json,
    OneLineErrors,
    OptionalFile,
    Plots,
    Record,
    Set,
    Workers,
    finite,
)
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
def loopback(
    file: OptionalFile = None,
    duration: Duration = None,
    json_out: Json = None,
    record: Record = None,
    set_: Set = None,
) -> None:
    """Run master and slave as two processes over UDP on 127.0.0.1."""
    path = file or Path(str(files("configs") / "loopback.yaml"))
    overrides = [*(set_ or ()), *_free_port(path, set_ or ())]
    _live("loopback", path, overrides, SIDES, duration, json_out, record)


@app.command()
def master(
    file: File, duration: Duration = None, json_out: Json = None, record: Record = None, set_: Set = None
) -> None:
    """Run the operator's side."""
    _live("master", file, set_ or (), [MASTER], duration, json_out, record)


@app.command()
def slave(
    file: File, duration: Duration = None, json_out: Json = None, record: Record = None, set_: Set = None
) -> None:
    """Run the teleoperator's side."""
    _live("slave", file, set_ or (), [SLAVE], duration, json_out, record)


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
    record: Record = None,
    set_: Set = None,
) -> None:
    """Run the whole system in virtual time, as fast as it goes."""
    from weberlink.simulate import simulate as run  # noqa: PLC0415

    with _errors():
        summary, recorder = run(load(file, set_ or ()), duration, record)
    problem = None if trace is None else _attempt(lambda: recorder.save(trace), trace)
    _finish(summary, f"weberlink simulate {file}", json_out, problem)


@app.command()
def info(
    recordings: Annotated[list[Path], typer.Argument(metavar="FILE...", help="One recording, or both sides' (MCAP).")],
    json_out: Json = None,
) -> None:
    """Say what a recording holds: its sides, its gaps, and the figures of the session."""
    from weberlink.recordings import describe  # noqa: PLC0415

    with _errors():
        description = describe(recordings)
    _write(description.document, json_out, description.show)


@app.command()
def export(
    recordings: Annotated[list[Path], typer.Argument(metavar="FILE...", help="One recording, or both sides' (MCAP).")],
    to: Annotated[str, typer.Option("--to", metavar="FORMAT", help="csv or parquet (extra: weberlink[parquet]).")],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Where to; beside the recording if not given.")
    ] = None,
) -> None:
    """Write a recording as tables, one for each side, on one time axis."""
    from weberlink.recordings import ExportError  # noqa: PLC0415
    from weberlink.recordings import export as run  # noqa: PLC0415

    try:
        with _errors():
            lines = run(recordings, to, out)
    except ExportError as error:
        _fail(str(error), FAILED)
    typer.echo("\n".join(lines))


@app.command()
def evaluate(
    traces: Annotated[list[Path], typer.Argument(metavar="TRACE...", help="Recorded signals (CSV or MCAP).")],
    predictor: Annotated[str, typer.Option(metavar="P,..", help="Predictors.")] = "zoh,linear,plane,sphere,hybrid",
    weber: Annotated[
        str, typer.Option(metavar="K,..", help='Weber factors; "paper" for 0.025,0.05,0.1,0.15,0.2,0.3.')
    ] = "0.10",
    floor: Annotated[float, typer.Option(metavar="N", min=0.0, callback=finite, help="Absolute threshold [N].")] = 0.02,
    jnd: Annotated[
        float, typer.Option(metavar="J", help="What a person just notices, as a share of the force, for every row.")
    ] = 0.10,
    wire: Annotated[bool, typer.Option("--wire/--no-wire", help="Quantize and saturate as on the wire.")] = True,
    workers: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Processes; as many as pay if not given.")
    ] = None,
    dask: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Scheduler of a Dask cluster for the work (extra: weberlink[dask])."),
    ] = None,
    json_out: Json = None,
    plots: Plots = None,
) -> None:
    """Run recorded signals through the codec."""
    from weberlink.evaluate import EvaluationError, Place, run  # noqa: PLC0415

    place = Place(workers, dask)
    try:
        with _errors(), _progress() as progress:
            result = run(
                traces, predictor, weber, floor,
                jnd=jnd, wire=wire, plots=plots is not None, place=place, progress=progress,
            )  # fmt: skip
    except EvaluationError as error:
        _fail(str(error), FAILED)
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
    workers: Workers = None,
    json_out: Json = None,
    plots: Plots = None,
) -> None:
    """Map which stiff and extreme cases stay bounded, and what energy they make."""
    from weberlink.stability import run  # noqa: PLC0415

    with _errors(), _progress() as progress:
        result = run(full=full, plots=plots is not None, workers=workers, progress=progress)
    _publish(result, json_out, plots)


@app.command()
def experiment(
    file: File,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the ledgers.")] = Path("experiment"),
    subject: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Number of the subject; the next that is free if not given.")
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(metavar="S", min=0.1, callback=finite, help="Length of a trial [s]; 10 if not given."),
    ] = None,
    seed: Annotated[int | None, typer.Option(metavar="N", min=0, help="Of the orders of trials.")] = None,
    simulate: Annotated[bool, typer.Option("--simulate", help="A program rates, in virtual time; no person.")] = False,
    record: Annotated[
        bool, typer.Option("--record/--no-record", help="Record each trial as MCAP (extra: weberlink[recording]).")
    ] = True,
    set_: Set = None,
) -> None:
    """Let a person feel and rate 30 blind trials; it goes on where it was left."""
    from evaluation.experiment.conduct import ConductError  # noqa: PLC0415
    from weberlink.experiment import Request  # noqa: PLC0415
    from weberlink.experiment import run as conduct  # noqa: PLC0415

    overrides = tuple(set_ or ())
    request = Request(file, overrides, out, subject, seed, duration, simulate, record)
    # A person sees nothing but what is asked of them.
    shown: AbstractContextManager[Callable[..., None]] = _progress() if simulate else nullcontext(lambda *_: None)
    with _errors(), shown as progress:
        try:
            words = conduct(
                request,
                ports=lambda: _free_port(file, list(overrides)),
                source=sys.stdin,
                screen=sys.stdout,
                report=lambda done, total: progress(done, total, "trials"),
            )
        except ConductError as error:
            _fail(str(error), FAILED)
        except OSError as error:
            _fail(f"{error.filename or out}: cannot be written: {error.strerror}", FAILED)
    typer.echo(words)


@app.command()
def ratings(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the ledgers of an experiment.")],
    level: Annotated[
        float,
        typer.Option(metavar="L", min=0.0, max=5.0, callback=finite, help="Rating at which packets are compared."),
    ] = 4.0,
    only: Annotated[
        str | None, typer.Option(metavar="WHOSE", help="people or simulated, where the folder has both.")
    ] = None,
    json_out: Json = None,
    csv_out: Annotated[Path | None, typer.Option("--csv", metavar="OUT", help="Write every rating as CSV.")] = None,
    plots: Plots = None,
) -> None:
    """Analyse the ratings of an experiment: means, tests, and packets saved at equal quality."""
    from weberlink.ratings import run  # noqa: PLC0415

    with _errors():
        result = run(folder, level=level, only=only, plots=plots is not None)
    problem = None if csv_out is None else _attempt(lambda: result.write_csv(csv_out), csv_out)
    _publish(result, json_out, plots)
    if problem is not None:
        _fail(problem, FAILED)


@app.command()
def paper(
    traces: Annotated[list[Path] | None, typer.Argument(metavar="[TRACE...]", help="Recordings of people.")] = None,
    workers: Workers = None,
    json_out: Json = None,
    plots: Plots = None,
) -> None:
    """Put the paper's claims beside what is measured on recordings and on simulated scenes."""
    from weberlink.paper import run  # noqa: PLC0415

    with _errors(), _progress() as progress:
        result = run(traces or [], plots=plots is not None, workers=workers, progress=progress)
    _publish(result, json_out, plots)


def main() -> None:
    """Entry point of the program."""
    app(prog_name="weberlink")


def _live(
    name: str,
    path: Path,
    overrides: list[str] | tuple[()],
    sides: Any,
    duration: float | None,
    json_out: Path | None,
    record: Path | None,
) -> None:
    from weberlink.composition.trial import try_out  # noqa: PLC0415
    from weberlink.launcher import Session  # noqa: PLC0415
    from weberlink.recorder import check_target  # noqa: PLC0415
    from weberlink.report import status_line  # noqa: PLC0415

    with _errors():
        configuration = load(path, overrides, sides)
        try_out(configuration)
        if record is not None:
            check_target(record)
    console = Console(stderr=True)
    with Live(Text("starting"), console=console, refresh_per_second=10, transient=True) as live:

        def watch(records: dict[str, Any], summary: dict[str, Any]) -> None:
            live.update(Text(status_line(records, summary)))

        watcher = watch if console.is_terminal else None
        with Session(configuration, overrides, sides, duration, watcher, record) as session:
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
    """Write and print what a study found, and draw it: what goes wrong with the one takes nothing of the other."""
    failed = None
    try:
        _write(study.document, json_out, lambda console: console.print(study.table))
    except typer.Exit as exit_:
        failed = exit_
    problem = None if plots is None else _attempt(lambda: study.draw(plots), plots)
    if problem is not None:
        _fail(problem, FAILED)
    if failed is not None:
        raise failed


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
    fits = console.is_terminal and 80 <= console.width <= 100  # narrower, a table would cut its numbers
    show(console if fits else Console(width=80))


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
