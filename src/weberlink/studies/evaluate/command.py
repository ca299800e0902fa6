"""The `evaluate` command: traces, predictors and Weber factors into rows, a table and figures.

Owns what its arguments mean, and where the work is done: here, in processes, or on a Dask cluster. What is computed is
in `weberlink.studies.evaluate`, and does not depend on where.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any, get_args

from rich.table import Table

from weberlink.codec.deadband import DEADBANDS, ISOTROPIC
from weberlink.codec.predictors import BANKS, PREDICTORS
from weberlink.master.trace import TraceError, read_trace
from weberlink.studies.evaluate.engine import Engine, fitting, prepare
from weberlink.studies.evaluate.naming import names
from weberlink.studies.evaluate.row import Row
from weberlink.studies.evaluate.sweep import Recording, Study, Task, length, rows_of
from weberlink.studies.evaluate.table import table_of
from weberlink.studies.paper.claims import WEBERS
from weberlink.studies.parallel import spread
from weberlink.system.configuration import ConfigurationError
from weberlink.system.environment import environment, footer
from weberlink.system.extras import need

UNQUANTIZED = {"force_step": 1e-9, "position_step": 1e-12, "saturates": False}
"""Steps far below any sensor's noise, without a range."""
PAPER = "paper"
AUTO = "auto"
WORTH_PROCESSES = 100_000.0
"""Coded samples from which other processes are done sooner than this one alone, which need not start."""

Progress = Callable[[int, int], None]
"""Told how many of how many pieces of work are done."""


class EvaluationError(RuntimeError):
    """What computed the rows went away before the end. One line says what and why."""


@dataclass(frozen=True)
class Place:
    """Where the work is done.

    Args:
        workers: processes; 1 for none but this one, None for as many as there are processors if that pays.
        dask: address of the scheduler of a cluster, instead; None for this machine.
    """

    workers: int | None = None
    dask: str | None = None


@dataclass(frozen=True)
class Evaluation:
    """The rows of all combinations, and how they are shown."""

    study: Study
    recordings: list[Recording]
    rows: list[Row]
    document: dict[str, Any]
    table: Table
    caption: str

    def draw(self, folder: Path) -> None:
        """Write the figures, and the rows as CSV.

        Raises:
            OSError: if the folder or a file in it cannot be made.
        """
        from weberlink.studies.evaluate.figures import draw_study  # noqa: PLC0415 - heavy, and only wanted with --plots

        folder.mkdir(parents=True, exist_ok=True)
        draw_study(self.study, self.recordings, self.rows, folder, self.caption)


def run(
    traces: Sequence[Path],
    predictors: str,
    webers: str,
    floor: float,
    *,
    jnd: float = 0.10,
    wire: bool = True,
    plots: bool = False,
    engine: str = AUTO,
    deadbands: str = ISOTROPIC,
    place: Place = Place(),
    progress: Progress = lambda *_: None,
) -> Evaluation:
    """Evaluate every combination. What does the work and where changes no row, but for the measured run time.

    Args:
        traces: recorded signals, each once.
        predictors: names with commas between them.
        webers: Weber factors with commas between them, or "paper" for those of the paper.
        floor: absolute threshold [N].
        jnd: a person's just noticeable difference, as a share of the force.
        wire: quantize and saturate as on the wire.
        plots: whether figures will be wanted.
        engine: what codes, "python" or "compiled"; "auto" for what is done soonest on this machine.
        deadbands: names of shapes of the deadband with commas between them.
        place: where the work is done.
        progress: told of it.

    Raises:
        ConfigurationError: for an argument, a trace or a cluster that cannot be used; nothing was computed then.
        EvaluationError: if a worker died.
    """
    began = perf_counter()
    if plots:
        need("matplotlib", "plots", "--plots")
    _check_place(place)
    if not 0.0 < jnd <= 1.0:
        raise ConfigurationError(f"--jnd: must be above 0 and at most 1, not {jnd:g}")
    exactness: dict[str, Any] = {} if wire else UNQUANTIZED
    named = _engine(engine)
    shapes = _deadbands(deadbands, floor, plots=plots)
    study = Study(_predictors(predictors), _webers(webers), floor, jnd=jnd, deadbands=shapes, **exactness)
    recordings = read_recordings(traces)
    samples = sum(map(length, study.tasks(recordings)))
    study = replace(study, engine=named or ("python" if place.dask is not None else fitting(samples)))
    rows = compute(study, recordings, place, progress)
    return assemble(study, recordings, rows, wire=wire, run_time=perf_counter() - began)


def compute(study: Study, recordings: Sequence[Recording], place: Place, progress: Progress) -> list[Row]:
    """Do all of the work, wherever it is done, and put it in order.

    Raises:
        ConfigurationError: for a cluster that cannot be used; nothing was computed then.
        EvaluationError: if a worker died.
    """
    tasks = study.tasks(recordings)
    if place.dask is None:
        prepare(study.engine)
    results: dict[int, list[Row]] = {}
    for index, rows in _on_cluster(tasks, place.dask) if place.dask is not None else _here(tasks, place.workers):
        results[index] = rows
        progress(len(results), len(tasks))
    return study.ordered(results)


def assemble(study: Study, recordings: list[Recording], rows: list[Row], *, wire: bool, run_time: float) -> Evaluation:
    """What is published of rows that took a run time [s]."""
    facts = environment()
    caption = footer(facts)
    document = {
        "floor_n": study.floor,
        "jnd": study.jnd,
        "wire": wire,
        "engine": study.engine,
        "rows": [row.as_json() for row in rows],
        "run_time_s": run_time,
        "environment": facts,
    }
    return Evaluation(study, recordings, rows, document, table_of(rows, study.jnd, run_time, caption), caption)


def _here(tasks: Sequence[Task], workers: int | None) -> Iterator[tuple[int, list[Row]]]:
    if workers is None and sum(map(length, tasks)) < WORTH_PROCESSES:
        workers = 1
    try:
        yield from spread(rows_of, tasks, workers, length)
    except BrokenProcessPool:
        raise EvaluationError(
            "a worker process died before the end, perhaps for lack of memory; try fewer of them with --workers"
        ) from None


def _on_cluster(tasks: Sequence[Task], address: str) -> Iterator[tuple[int, list[Row]]]:
    from weberlink.studies.evaluate.cluster import LostClusterError, UnavailableClusterError, spread_on_cluster  # noqa: PLC0415 - heavy, an extra

    try:
        yield from spread_on_cluster(address, rows_of, tasks, length)
    except UnavailableClusterError as error:
        raise ConfigurationError(f"--dask: {error}") from None
    except LostClusterError as error:
        raise EvaluationError(f"--dask: {error}") from None
    except ModuleNotFoundError as error:
        raise EvaluationError(f"--engine compiled: a worker of the cluster has no {error.name}") from None


def _check_place(place: Place) -> None:
    if place.dask is None:
        return
    need("distributed", "dask", "--dask")
    if place.workers is not None:
        raise ConfigurationError("--workers: is for this machine; with --dask it is the cluster that has workers")


def read_recordings(paths: Sequence[Path]) -> list[Recording]:
    """Traces under names that are all different, however alike those of their files are.

    Raises:
        ConfigurationError: for one that cannot be used, or is listed twice.
    """
    seen: dict[Path, Path] = {}
    for path in paths:
        if path.resolve() in seen:
            raise ConfigurationError(f"{path}: listed twice, and would count twice in every mean")
        seen[path.resolve()] = path
    try:
        return [Recording(name, read_trace(path)) for name, path in zip(names(paths), paths, strict=True)]
    except TraceError as error:
        raise ConfigurationError(str(error)) from None


def _engine(text: str) -> Engine | None:
    """None where it is to be chosen."""
    if text == AUTO:
        return None
    for known in get_args(Engine):
        if text == known:
            if known == "compiled":
                need("numba", "compiled", "--engine compiled")
            return known  # type: ignore[no-any-return]
    raise ConfigurationError(f"--engine: {text!r} is none of {', '.join((AUTO, *get_args(Engine)))}")


def _predictors(text: str) -> list[str]:
    listed = [name.strip() for name in text.split(",")]
    known = [*PREDICTORS, *BANKS]
    for name in listed:
        if name not in known:
            raise ConfigurationError(f"--predictor: {name!r} is none of {', '.join(known)}")
    _check_once("--predictor", listed)
    return listed


def _deadbands(text: str, floor: float, *, plots: bool) -> list[str]:
    listed = [name.strip() for name in text.split(",")]
    for name in listed:
        if name not in DEADBANDS:
            raise ConfigurationError(f"--deadband: {name!r} is none of {', '.join(DEADBANDS)}")
    _check_once("--deadband", listed)
    if "level_crossing" in listed and floor == 0.0:
        raise ConfigurationError("--deadband level_crossing: needs --floor above 0, which is the lowest level")
    if plots and len(listed) > 1:
        raise ConfigurationError("--plots: draws one shape of the deadband; name one with --deadband")
    return listed


def _webers(text: str) -> list[float]:
    if text.strip() == PAPER:
        return list(WEBERS)
    try:
        factors = [float(part) for part in text.split(",")]
    except ValueError:
        raise ConfigurationError(
            f"--weber: must be numbers with commas between them, not {text!r}, or {PAPER!r}"
        ) from None
    for factor in factors:
        if not 0.0 <= factor <= 1.0:
            raise ConfigurationError(f"--weber: must be 0 to 1, not {factor:g}")
    _check_once("--weber", factors)
    return factors


def _check_once(option: str, values: Sequence[object]) -> None:
    for place, value in enumerate(values):
        if value in values[:place]:
            raise ConfigurationError(f"{option}: {value} is listed twice")
