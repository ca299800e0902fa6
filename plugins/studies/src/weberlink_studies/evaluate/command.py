"""The `evaluate` command: recorded signals through the codec."""

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from weberlink.codec.choice import CHOICES
from weberlink.codec.deadband import DEADBANDS, ISOTROPIC
from weberlink.codec.predictors import PREDICTORS
from weberlink.config import ConfigurationError
from weberlink.config.model import LONGEST_LOOKAHEAD_MS
from weberlink_studies.coded_trace import TickWindow
from weberlink_studies.evaluate.study import SAMPLE_S, EvaluationCase, EvaluationStudy, rows_of
from weberlink_studies.evaluate.table import by_source, tables_of
from weberlink_studies.evaluate.traces import NamedTrace, read_traces, units_of
from weberlink_studies.frame import FrameResult, Study, check_resources, records
from weberlink_studies.paper.claims import WEBERS
from weberlink_studies.parallel import Progress

if TYPE_CHECKING:
    from pandas import DataFrame

UNQUANTIZED = {"force_step": 1e-9, "position_step": 1e-12, "saturates": False}
"""Steps far below the noise of any sensor, and no range."""
PAPER = "paper"
ALL = "all"


@dataclass(frozen=True)
class EvaluationOptions:
    """What is evaluated."""

    study: EvaluationStudy  # what varies for every trace, and what is the same for all
    traces: Sequence[NamedTrace]  # the signals; the first is drawn over time
    wire: bool  # whether `study` quantizes and saturates as on the wire
    window: TickWindow | None  # of the first trace that is drawn; None for the second that shows most


def _summary(options: EvaluationOptions, rows: "DataFrame") -> dict[str, Any]:
    study = options.study
    return {
        "floor_n": study.floor,
        "lookahead_ms": study.lookahead_ms,
        "jnd": study.jnd,
        "wire": options.wire,
        "max_updates_per_s": study.max_updates_per_s,
        "sources": records(by_source(rows[rows.channel == "force"])),
    }


def _plots(options: EvaluationOptions, rows: "DataFrame", folder: Path, caption: str) -> None:
    from weberlink_studies.evaluate.figures import draw_study  # noqa: PLC0415 - imports matplotlib

    draw_study(options.study, options.traces, rows, folder, caption, options.window)


STUDY: Study[EvaluationOptions, EvaluationCase] = Study(
    "evaluate",
    lambda options: options.study.cases(options.traces),
    rows_of,
    lambda options, rows, run_time_s, caption: tables_of(rows, options.study.jnd, run_time_s, caption),
    _plots,
    lambda case: SAMPLE_S * len(case.trace.trace.time_s) * len(case.webers),
    _summary,
)


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
    position: bool = False,
    deadbands: str = ISOTROPIC,
    max_updates: float | None = None,
    units: str | None = None,
    period: tuple[float | None, float | None] = (None, None),
    workers: int | None = None,
    dask: str | None = None,
    progress: Progress = lambda *_: None,
) -> FrameResult:
    """Evaluate every combination, or those that are done when Ctrl-C or SIGTERM comes.

    Rows do not depend on where they were computed, except for the measured run time.
    """
    check_resources(workers, dask)
    if not 0.0 < jnd <= 1.0:
        raise ConfigurationError(f"--jnd: must be above 0 and at most 1, not {jnd:g}")
    if not 0.0 <= lookahead_ms <= LONGEST_LOOKAHEAD_MS:
        raise ConfigurationError(f"--lookahead: must be 0 to {LONGEST_LOOKAHEAD_MS:g} ms, not {lookahead_ms:g}")
    known = (*PREDICTORS, *CHOICES)
    forces = list(known) if predictors == ALL else _names("--predictor", predictors, known)
    positions = [name for name in forces if name in CHOICES or not PREDICTORS[name].geometric] if position else []
    study = EvaluationStudy(
        forces,
        _webers(webers),
        floor,
        jnd=jnd,
        deadbands=_deadbands(deadbands, floor, plots=plots),
        lookahead_ms=lookahead_ms,
        max_updates_per_s=max_updates,
        position_predictors=positions,
        **({} if wire else UNQUANTIZED),  # type: ignore[arg-type]
    )
    named = read_traces(traces, None if units is None else units_of(units))
    window = _window(named[0], period) if plots else None
    return STUDY.result(EvaluationOptions(study, named, wire, window), workers=workers, dask=dask, progress=progress)


def _window(trace: NamedTrace, period: tuple[float | None, float | None]) -> TickWindow | None:
    """The ticks of a trace in a period [s], None for its begin or end; None for no period."""
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
