"""The study commands."""

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from weberlink.cli.arguments import CommandGroup, File, Json, Set, file_target, finite, folder_target
from weberlink.cli.output import attempt, fail, progress_bar, write
from weberlink.cli.sessions import one_host
from weberlink.order import FAILED, INTERRUPTED
from weberlink.session.targets import STANDARD_OUTPUT
from weberlink_studies.drawing import Drawing, Footer, Format, drawn_as, formats_of

if TYPE_CHECKING:
    from weberlink_studies.frame import FrameResult
    from weberlink_studies.parallel import Progress
    from weberlink_studies.result import StudyResult

Plots = Annotated[Path | None, typer.Option("--plots", metavar="DIR", callback=folder_target, help="Draw figures.")]
Workers = Annotated[
    int | None, typer.Option("--workers", metavar="N", min=1, help="Number of processes; default: that of processors.")
]
Dask = Annotated[
    str | None, typer.Option("--dask", metavar="ADDRESS", help="Scheduler of a Dask cluster that works (extra: dask).")
]
Csv = Annotated[Path | None, typer.Option("--csv", metavar="OUT", callback=file_target, help="Write every row as CSV.")]
Full = Annotated[bool, typer.Option("--full", help="Run the full, finer study, which takes longer.")]


class Studies(CommandGroup):
    """The studies, and those of other distributions."""

    extended_by = "weberlink.studies"


study = typer.Typer(name="study", cls=Studies, help="Reproduce and extend the studies.", no_args_is_help=True)


def publish(
    study: "StudyResult", json_out: Path | None, plots: Path | None, *, footer: bool = True, formats: str | None = None
) -> None:
    """Print, write and draw the results of a study; a failure of one does not prevent the others.

    After Ctrl-C these are the partial results, and the exit status is `INTERRUPTED`.
    """
    document = study.document | ({"interrupted": True} if study.interrupted else {})
    failed = None
    try:
        write(document, json_out, lambda console: console.print(study.table))
    except typer.Exit as exit_:
        failed = exit_
    kept = "printed" if json_out is None else "in the JSON above" if json_out == STANDARD_OUTPUT else f"in {json_out}"
    try:
        with drawn_as(Drawing(footer, formats_of(formats))):
            problem = None if plots is None else attempt(lambda: study.draw(plots), plots)
    except KeyboardInterrupt:
        fail(f"interrupted while drawing: the results are {kept}, not all figures are in {plots}", INTERRUPTED)
    if problem is not None:
        fail(problem, FAILED)
    if failed is not None:
        raise failed
    if study.interrupted:
        undrawn = "; no figures are drawn of them" if plots is not None and study.figures is None else ""
        fail(f"interrupted: {study.interrupted} are done, and {kept}{undrawn}", INTERRUPTED)


def publish_rows(
    study: "FrameResult",
    json_out: Path | None,
    csv_out: Path | None,
    plots: Path | None,
    footer: bool = True,
    formats: str | None = None,
) -> None:
    """Publish a study, and its rows as CSV; a failure of one does not prevent the others."""
    problem = None if csv_out is None else attempt(lambda: study.write_csv(csv_out), csv_out)
    publish(study, json_out, plots, footer=footer, formats=formats)
    if problem is not None:
        fail(problem, FAILED)


@contextmanager
def progress_shown() -> "Iterator[Progress]":
    """The progress of a study; the loss of a worker ends the command with one line."""
    from weberlink_studies.frame import StudyError  # noqa: PLC0415 - not for the help

    try:
        with progress_bar() as progress:
            yield progress
    except StudyError as error:
        fail(str(error), FAILED)


@study.command()
def evaluate(  # noqa: PLR0917 - an argument for each option
    traces: Annotated[
        list[Path],
        typer.Argument(
            metavar="TRACE...",
            help="Recorded signals: files (CSV, npz or MCAP); or shipped ones: tue_rigid_1, tue for all that begin so, "
            "recordings for all.",
        ),
    ],
    predictor: Annotated[
        str, typer.Option(metavar="P,..", help='Predictors; "all" for every one that a configuration can name.')
    ] = "zoh,linear,plane,sphere,hybrid",
    weber: Annotated[
        str, typer.Option(metavar="K,..", help='Weber factors; "paper" for 0.025,0.05,0.1,0.15,0.2,0.3.')
    ] = "0.10",
    floor: Annotated[float, typer.Option(metavar="N", min=0.0, callback=finite, help="Absolute threshold [N].")] = 0.02,
    deadband: Annotated[
        str, typer.Option(metavar="SHAPE,..", help="Deadbands: isotropic, cone, level_crossing, velocity_adaptive.")
    ] = "isotropic",
    lookahead: Annotated[
        float, typer.Option(metavar="MS", callback=finite, help="How far the encoder looks ahead [ms].")
    ] = 0.0,
    jnd: Annotated[
        float, typer.Option(metavar="J", help="Just noticeable difference, as a share of the force.")
    ] = 0.10,
    max_updates: Annotated[
        float | None, typer.Option(metavar="N", min=1.0, callback=finite, help="Largest rate of updates [1/s].")
    ] = None,
    position: Annotated[bool, typer.Option("--position", help="The position channel beside the force.")] = False,
    wire: Annotated[bool, typer.Option("--wire/--no-wire", help="Quantize and saturate as on the wire.")] = True,
    units: Annotated[
        str | None,
        typer.Option("--units", metavar="U,..", help="Units of CSV files, such as mm,ms; default: SI units."),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Number of processes; default: by the amount of work.")
    ] = None,
    dask: Dask = None,
    json_out: Json = None,
    csv_out: Csv = None,
    plots: Plots = None,
    footer: Footer = True,
    format_: Format = None,
    from_: Annotated[
        float | None, typer.Option("--from", metavar="S", callback=finite, help="Begin of the drawn forces [s].")
    ] = None,
    until: Annotated[
        float | None, typer.Option("--to", metavar="S", callback=finite, help="End of the drawn forces [s].")
    ] = None,
) -> None:
    """Code recorded signals: packets, error and run time.

    Takes some seconds for a recording of a minute, and minutes for all shipped ones at all Weber factors. Ctrl-C stops
    early and reports the finished rows.
    """
    from weberlink_studies.evaluate.command import run  # noqa: PLC0415

    with progress_shown() as progress:
        result = run(
            traces, predictor, weber, floor,
            lookahead_ms=lookahead, jnd=jnd, wire=wire, position=position, plots=plots is not None,
            deadbands=deadband,
            max_updates=max_updates, units=units, period=(from_, until),
            workers=workers, dask=dask, progress=progress,
        )  # fmt: skip
    publish_rows(result, json_out, csv_out, plots, footer, format_)


@study.command()
def precision(
    full: Full = False,
    json_out: Json = None,
    csv_out: Csv = None,
    plots: Plots = None,
    footer: Footer = True,
    format_: Format = None,
) -> None:
    """Measure error against run time of the integrators.

    Takes half a minute on two idle cores; with --full many minutes. Ctrl-C ends it with the problems so far.
    """
    from weberlink_studies.precision.study import FULL, Effort, run  # noqa: PLC0415

    with progress_shown() as progress:
        result = run(FULL if full else Effort(), progress=progress)
    publish_rows(result, json_out, csv_out, plots, footer, format_)


@study.command()
def stability(
    full: Full = False,
    cells: Annotated[
        bool, typer.Option("--cells", help="What is felt in 156 scenes, delays, links and hands instead; ten minutes.")
    ] = False,
    scheme: Annotated[
        list[str] | None,
        typer.Option("--scheme", metavar="NAME", help="Of --cells; may be repeated. Default: bounded."),
    ] = None,
    held_out: Annotated[
        int | None,
        typer.Option(
            "--held-out",
            metavar="SEED",
            min=0,
            help="48 cells that this seed draws instead of the 156, and the baselines beside bounded; implies --cells.",
        ),
    ] = None,
    files: Annotated[
        bool, typer.Option("--files", help="The shipped files at 0 to 150 ms each way; implies --cells. Ten minutes.")
    ] = False,
    workers: Workers = None,
    dask: Dask = None,
    json_out: Json = None,
    csv_out: Csv = None,
    plots: Plots = None,
    footer: Footer = True,
    format_: Format = None,
) -> None:
    """Map stability, force and energy on stiff and extreme cases.

    Takes two and a half minutes on two idle cores; with --full an hour. Ctrl-C stops early and reports the finished
    cells.
    """
    from weberlink_studies.frame import check_resources  # noqa: PLC0415

    with progress_shown() as progress:
        check_resources(workers, dask)
        if cells or files or held_out is not None:
            from weberlink_studies.stability import display  # noqa: PLC0415

            result = display.run(
                scheme or [],
                held_out,
                files=files,
                plots=plots is not None,
                workers=workers,
                dask=dask,
                progress=progress,
            )
        else:
            from weberlink_studies.stability.study import STUDY, MapOptions  # noqa: PLC0415

            result = STUDY.result(MapOptions(full), workers=workers, dask=dask, progress=progress)
    publish_rows(result, json_out, csv_out, plots, footer, format_)


@study.command()
def experiment(
    file: File,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", callback=folder_target, help="Folder of the ledgers.")
    ] = Path("experiment"),
    subject: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Number of the subject; default: the next free one.")
    ] = None,
    duration: Annotated[
        float | None, typer.Option(metavar="S", min=0.1, callback=finite, help="Length of a trial [s]; default: 10.")
    ] = None,
    seed: Annotated[int | None, typer.Option(metavar="N", min=0, help="Seed of the order of the trials.")] = None,
    simulate: Annotated[bool, typer.Option("--simulate", help="Let a program rate, in virtual time.")] = False,
    record: Annotated[
        bool, typer.Option("--record/--no-record", help="Record each trial as MCAP (weberlink-recording).")
    ] = True,
    set_: Set = None,
) -> None:
    """Conduct the paper's study: one person rates blind trials.

    Takes a person about 10 minutes, and --simulate about one. An interrupted study continues where it stopped.
    """
    from weberlink_studies.experiment.command import (  # noqa: PLC0415
        ExperimentRequest,
        check_device,
        run as conduct,
    )
    from weberlink_studies.experiment.conduct import ConductError  # noqa: PLC0415

    overrides = tuple(set_ or ())
    request = ExperimentRequest(file, overrides, out, subject, seed, duration, simulate, record)
    # A progress bar would reveal the conditions to the subject.
    shown: AbstractContextManager[Callable[..., None]] = progress_bar() if simulate else nullcontext(lambda *_: None)
    check_device(request)
    with shown as progress:
        try:
            words = conduct(
                request,
                ports=lambda: one_host(file, overrides),
                source=sys.stdin,
                screen=sys.stdout,
                report=lambda done, total: progress(done, total, "trials"),
            )
        except ConductError as error:
            fail(str(error), FAILED)
        except OSError as error:
            fail(f"{error.filename or out}: cannot be written: {error.strerror}", FAILED)
    typer.echo(words)


@study.command()
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
    csv_out: Csv = None,
    plots: Plots = None,
    footer: Footer = True,
    format_: Format = None,
) -> None:
    """Analyse ratings: means, tests, packets at equal quality.

    Takes some seconds.
    """
    from weberlink_studies.experiment.ratings import run  # noqa: PLC0415

    result = run(folder, level=level, only=only)
    publish_rows(result, json_out, csv_out, plots, footer, format_)


@study.command()
def paper(
    traces: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[TRACE...]", help="Recordings of people: files, or shipped ones by name; default: all of these."
        ),
    ] = None,
    workers: Workers = None,
    json_out: Json = None,
    csv_out: Csv = None,
    plots: Plots = None,
) -> None:
    """Compare the paper's claims with measurements.

    Takes some minutes on two idle cores. Ctrl-C ends it with the claims on the signals that are done.
    """
    from weberlink_studies.paper.command import run  # noqa: PLC0415

    with progress_shown() as progress:
        result = run(traces or [], workers=workers, progress=progress)
    publish_rows(result, json_out, csv_out, plots)  # the page names its pictures
