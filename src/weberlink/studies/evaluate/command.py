"""The `evaluate` command: code traces in processes, and assemble rows, table and figures."""

from collections.abc import Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from time import perf_counter

import numpy as np

from weberlink.codec.deadband import DEADBANDS, ISOTROPIC
from weberlink.codec.predictors import BANKS, PREDICTORS
from weberlink.studies.coded_trace import TickWindow
from weberlink.studies.evaluate.by_source import by_source
from weberlink.studies.evaluate.study import EvaluationRow, EvaluationStudy, EvaluationTask, coded_samples, rows_of
from weberlink.studies.evaluate.table import tables_of
from weberlink.studies.evaluate.traces import NamedTrace, read_traces, units_of
from weberlink.studies.paper.claims import WEBERS
from weberlink.studies.parallel import Progress, parallel_map
from weberlink.studies.result import StudyResult, how_much
from weberlink.system.configuration import ConfigurationError
from weberlink.system.configuration.extras import need
from weberlink.system.configuration.model import LONGEST_LOOKAHEAD_MS
from weberlink.system.environment import environment, footer

UNQUANTIZED = {"force_step": 1e-9, "position_step": 1e-12, "saturates": False}
"""Steps far below the noise of any sensor, and no range."""
PAPER = "paper"
WORTH_PROCESSES = 100_000.0
"""Number of coded samples above which starting other processes saves time."""


class EvaluationError(RuntimeError):
    """A worker process died before the end. The message is one line."""


@dataclass(frozen=True)
class Evaluation(StudyResult):
    """The rows of all combinations. `draw` writes the figures, and the rows as CSV."""

    rows: list[EvaluationRow]


def run(
    traces: Sequence[Path],
    predictors: str,
    webers: str,
    floor: float,
    *,
    lookahead_ms: float = 0.0,
    jnd: float = 0.10,
    wire: bool = True,
    plots: bool = False,
    deadbands: str = ISOTROPIC,
    max_updates: float | None = None,
    units: str | None = None,
    period: tuple[float | None, float | None] = (None, None),
    workers: int | None = None,
    progress: Progress = lambda *_: None,
) -> Evaluation:
    """Evaluate every combination, or those that are done when Ctrl-C ends it.

    The rows do not depend on the workers, except for the measured run time.

    Args:
        traces: files, or names of shipped recordings and of their sources; each recording once.
        predictors: names, separated by commas.
        webers: Weber factors, separated by commas, or "paper" for those of the paper.
        floor: absolute threshold [N].
        lookahead_ms: how far the encoder looks ahead, 0 to `LONGEST_LOOKAHEAD_MS`.
        jnd: just noticeable difference of a person, as a share of the force; its absolute threshold is the default.
        wire: quantize and saturate as on the wire.
        plots: whether figures will be drawn.
        deadbands: names of shapes, separated by commas.
        max_updates: largest rate of updates [1/s]; None for no limit.
        units: of CSV files, such as "mm,ms"; None for SI units, which must be plausible then.
        period: of the first trace that is drawn [s], on its own time; None for its begin and its end, and with both
            None for the second that shows most.
        workers: processes; 1 for this process alone, None for one per processor if that saves time.
        progress: called after every task.

    Raises:
        ConfigurationError: for an argument or a trace that cannot be used; nothing was computed then.
        EvaluationError: a worker died.
    """
    began = perf_counter()
    if plots:
        need("matplotlib", "plots", "--plots")
    if not 0.0 < jnd <= 1.0:
        raise ConfigurationError(f"--jnd: must be above 0 and at most 1, not {jnd:g}")
    if not 0.0 <= lookahead_ms <= LONGEST_LOOKAHEAD_MS:
        raise ConfigurationError(f"--lookahead: must be 0 to {LONGEST_LOOKAHEAD_MS:g} ms, not {lookahead_ms:g}")
    study = EvaluationStudy(
        _names("--predictor", predictors, (*PREDICTORS, *BANKS)),
        _webers(webers),
        floor,
        jnd=jnd,
        deadbands=_deadbands(deadbands, floor, plots=plots),
        lookahead_ms=lookahead_ms,
        max_updates_per_s=max_updates,
        **({} if wire else UNQUANTIZED),  # type: ignore[arg-type]
    )
    named = read_traces(traces, None if units is None else units_of(units))
    window = _window(named[0], period) if plots else None
    tasks = study.tasks(named)
    results = _compute(tasks, workers, progress)
    interrupted = how_much(len(results), len(tasks), "tasks")
    rows = study.ordered(results)
    run_time, facts = perf_counter() - began, environment()
    caption = footer(facts)
    document = {
        "floor_n": floor,
        "lookahead_ms": lookahead_ms,
        "jnd": jnd,
        "wire": wire,
        "max_updates_per_s": max_updates,
        "sources": [one.as_json() for one in by_source(rows)],
        "rows": [row.as_json() for row in rows],
        "run_time_s": run_time,
        "environment": facts,
    }

    def draw(folder: Path) -> None:
        from weberlink.studies.evaluate.figures import draw_study  # noqa: PLC0415 - imports matplotlib

        draw_study(study, named, rows, folder, caption, window)

    table = tables_of(rows, jnd, run_time, caption) if rows else caption
    # A curve over Weber factors needs all of them.
    return Evaluation(document, table, None if interrupted else draw, rows, interrupted=interrupted)


def _compute(
    tasks: Sequence[EvaluationTask], workers: int | None, progress: Progress
) -> dict[int, list[EvaluationRow]]:
    if workers is None and sum(map(coded_samples, tasks)) < WORTH_PROCESSES:
        workers = 1
    try:
        return parallel_map(rows_of, tasks, workers, coded_samples, progress)
    except BrokenProcessPool:
        raise EvaluationError(
            "a worker process died before the end, perhaps for lack of memory; try fewer of them with --workers"
        ) from None


def _window(trace: NamedTrace, period: tuple[float | None, float | None]) -> TickWindow | None:
    """The ticks of a trace in a period [s], None for its begin or end; None for no period.

    Raises:
        ConfigurationError: there are fewer than two.
    """
    begin, until = period
    if begin is None and until is None:
        return None
    times = trace.trace.time_s
    first = 0 if begin is None else int(np.searchsorted(times, begin))
    beyond = len(times) if until is None else int(np.searchsorted(times, until, side="right"))
    if beyond - first < 2:
        raise ConfigurationError(
            f"--from, --to: {trace.name} has no two samples there; its time is {times[0]:g} to {times[-1]:g} s"
        )
    return TickWindow(first, beyond)


def _names(option: str, text: str, known: Sequence[str]) -> list[str]:
    listed = [name.strip() for name in text.split(",")]
    for name in listed:
        if name not in known:
            nearest = get_close_matches(name, known, n=1)
            meant = f"; did you mean {nearest[0]}?" if nearest else ""
            raise ConfigurationError(f"{option}: {name!r} is none of {', '.join(known)}{meant}")
    _check_once(option, listed)
    return listed


def _deadbands(text: str, floor: float, *, plots: bool) -> list[str]:
    listed = _names("--deadband", text, tuple(DEADBANDS))
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
