"""The files of `weberlink study evaluate --plots`: curves over the Weber factor, forces over time."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from weberlink.studies.coded_trace import CodedTrace, TickWindow
from weberlink.studies.curve_figures import CurveFigures, QualityAxis
from weberlink.studies.curves import curves
from weberlink.studies.evaluate.study import EvaluationStudy
from weberlink.studies.evaluate.traces import NamedTrace
from weberlink.studies.force_figure import draw_force
from weberlink.system.scoring.perception import ABSOLUTE_THRESHOLD_N

if TYPE_CHECKING:
    from pandas import DataFrame

USUAL_WEBER = 0.10


def draw_study(
    study: EvaluationStudy,
    traces: Sequence[NamedTrace],
    rows: "DataFrame",
    folder: Path,
    caption: str,
    window: TickWindow | None = None,
) -> None:
    """Write all figures into an existing folder.

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
    quality = QualityAxis("error_rms_jnd", "error, RMS [JND]", better="lower")
    found = curves(rows.rename(columns={"trace": "unit"}), quality.column)
    title = traces[0].name if len(traces) == 1 else f"{len(traces)} traces"
    told = f"A JND is {100 * study.jnd:g} % of the force, at least {ABSOLUTE_THRESHOLD_N:g} N.\n{caption}"
    CurveFigures(found, quality, told, title, units="traces").write(folder)
    weber = min(study.webers, key=lambda weber: abs(weber - USUAL_WEBER))
    _draw_force(study, traces[0], weber, folder / "force", caption, window)


def _draw_force(
    study: EvaluationStudy, trace: NamedTrace, weber: float, stem: Path, caption: str, window: TickWindow | None
) -> None:
    """The first trace over time, with every predictor."""
    runs = [CodedTrace(trace.trace, study.channel(name, weber)) for name in study.predictors]
    draw_force(runs, stem, title=f"Force over time, {trace.name}, k = {weber:g}", caption=caption, window=window)
