"""The files of `weberlink study evaluate --plots`: curves over the Weber factor, forces over time, fitted surfaces."""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from weberlink.codec.predictors import PREDICTORS
from weberlink.studies.curve_figures import CurveFigures, QualityAxis
from weberlink.studies.curves import Observation, curves
from weberlink.studies.evaluate.study import EvaluationRow, EvaluationStudy
from weberlink.studies.evaluate.traces import NamedTrace
from weberlink.studies.moments.figures import draw_force, draw_model
from weberlink.studies.moments.moments import CodedTrace, TickWindow, longest
from weberlink.system.scoring.perception import ABSOLUTE_THRESHOLD_N

USUAL_WEBER = 0.10


def draw_study(
    study: EvaluationStudy,
    traces: Sequence[NamedTrace],
    rows: Sequence[EvaluationRow],
    folder: Path,
    caption: str,
    window: TickWindow | None = None,
) -> None:
    """Write all figures and tables into an existing folder.

    Args:
        study: that gave the rows.
        traces: of the rows, the first of which is drawn over time.
        rows: of all combinations.
        folder: of the files.
        caption: names the environment of the rows.
        window: of the first trace that is drawn; None for the second that shows most.

    Raises:
        OSError: a file cannot be written.
    """
    write_rows(rows, folder / "rows.csv")
    observed = [Observation(row.trace, row.predictor, row.weber, row.packets_per_s, row.error_rms_jnd) for row in rows]
    quality = QualityAxis("error, RMS [JND]", better="lower", column="error_rms_jnd")
    title = traces[0].name if len(traces) == 1 else f"{len(traces)} traces"
    told = f"A JND is {100 * study.jnd:g} % of the force, at least {ABSOLUTE_THRESHOLD_N:g} N.\n{caption}"
    CurveFigures(curves(observed), quality, told, title, units="traces").write(folder)
    weber = min(study.webers, key=lambda weber: abs(weber - USUAL_WEBER))
    _draw_moment(study, traces[0], weber, folder / "force", caption, window)
    _draw_models(study, traces, weber, folder, caption)


def write_rows(rows: Sequence[EvaluationRow], path: Path) -> None:
    """Write all rows as CSV; a cell is empty where a figure does not apply."""
    flat = [_flat(row) for row in rows]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(dict.fromkeys(key for row in flat for key in row)), lineterminator="\n")
        writer.writeheader()
        writer.writerows(flat)


def _flat(row: EvaluationRow) -> dict[str, Any]:
    document = row.as_json()
    selected = document.pop("selected", {})
    return document | {f"selected_{name}": sends for name, sends in selected.items()}


def _draw_moment(
    study: EvaluationStudy, trace: NamedTrace, weber: float, stem: Path, caption: str, window: TickWindow | None
) -> None:
    """The first trace over time, with every predictor."""
    runs = [CodedTrace(trace.trace, study.channel(name, weber)) for name in study.predictors]
    draw_force(runs, stem, title=f"Force over time, {trace.name}, k = {weber:g}", caption=caption, window=window)


def _draw_models(
    study: EvaluationStudy, traces: Sequence[NamedTrace], weber: float, folder: Path, caption: str
) -> None:
    """For each predictor that fits surfaces, the one in use longest, on the first trace that has one."""
    for name in study.predictors:
        if name in PREDICTORS and not PREDICTORS[name].geometric:
            continue
        for trace in traces:
            run = CodedTrace(trace.trace, study.channel(name, weber))
            fit = longest(run.fits)
            if fit is not None:
                title = f"Fitted surface, {trace.name}, {name}, k = {weber:g}"
                draw_model(run, fit.newest.tick, folder / f"model_{name}", title=title, caption=caption)
                break
