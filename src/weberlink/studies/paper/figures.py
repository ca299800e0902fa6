"""The figures of `weberlink study paper`: curves of every condition, and single moments of one scene."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from weberlink.codec import Channel
from weberlink.codec.predictors.model import ModelKind
from weberlink.master.trace import Trace
from weberlink.slave.scenes.scene import Scene
from weberlink.studies.curve_figures import CurveFigures, QualityAxis
from weberlink.studies.curves import curves
from weberlink.studies.moments.figures import draw_force, draw_model
from weberlink.studies.moments.moments import CodedTrace, ModelFit, with_surface
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


def draw_moments(
    trace: Trace, scene: Scene | None, channel: Callable[[str], Channel], folder: Path, caption: str
) -> list[str]:
    """Write Figs. 2 and 3 (`force`), and 6 (`plane`, `sphere`) of one signal into an existing folder.

    Returns:
        Names of the figures: a signal may have no plane, or no sphere.

    Raises:
        OSError: a file cannot be written.
    """
    runs = [CodedTrace(trace, channel(name)) for name in ("zoh", "linear")]
    draw_force(runs, folder / "force", title="Force over time, hold and linear prediction", caption=caption)
    drawn = ["force"]
    hybrid = CodedTrace(trace, channel("hybrid"))
    for name, kind in (("plane", ModelKind.PLANE), ("sphere", ModelKind.SPHERE)):
        touched = _longest_touch(trace, with_surface(hybrid.fits, kind))
        if len(touched):
            title = f"The {name} that was felt longest, {len(touched)} ticks"
            middle = int(touched[len(touched) // 2])
            draw_model(hybrid, middle, folder / name, scene, title=title, caption=caption)
            drawn.append(name)
    return drawn


def _longest_touch(trace: Trace, candidates: Iterable[ModelFit]) -> NDArray[np.int64]:
    """The ticks in contact of the model with most of them; in free space a model stays in use and predicts 0."""
    contact = np.flatnonzero(trace.force_n.any(axis=1))
    touches = [contact[(contact >= fit.newest.tick) & (contact < fit.until)] for fit in candidates]
    return max(touches, key=len, default=contact[:0])
