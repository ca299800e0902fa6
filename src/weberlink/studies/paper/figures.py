"""The figures of `weberlink study paper`: curves of every condition, and forces over time of one scene."""

from collections.abc import Callable, Sequence
from pathlib import Path

from weberlink.codec import Channel
from weberlink.master.trace import Trace
from weberlink.studies.coded_trace import CodedTrace
from weberlink.studies.curve_figures import CurveFigures, QualityAxis
from weberlink.studies.curves import curves
from weberlink.studies.force_figure import draw_force
from weberlink.studies.paper.document import PaperCondition

QUALITY = QualityAxis("force error, RMS [JND]", better="lower", column="error_rms_jnd")


def draw_conditions(conditions: Sequence[PaperCondition], folder: Path, caption: str) -> None:
    """Write Figs. 7 to 9 of every condition with observations, each into its own folder.

    Raises:
        OSError: a file cannot be written.
    """
    for condition in conditions:
        if condition.observations:
            place = folder / condition.key
            place.mkdir(exist_ok=True)
            found = curves(condition.observations)
            CurveFigures(found, QUALITY, caption, condition.title, units="signals").write(place)


def draw_forces(trace: Trace, channel: Callable[[str], Channel], stem: Path, caption: str) -> None:
    """Write Figs. 2 and 3 of one signal.

    Raises:
        OSError: a file cannot be written.
    """
    runs = [CodedTrace(trace, channel(name)) for name in ("zoh", "linear")]
    draw_force(runs, stem, title="Force over time, hold and linear prediction", caption=caption)
