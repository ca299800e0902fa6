"""The figures and tables that a study leaves in a folder. Needs matplotlib (extra: plots), which nothing else imports.

Owns which figures there are: packet rate and error over the Weber factor with confidence over traces, and of one trace
the forces over time and a fitted surface.
"""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from weberlink.codec.predictors import PREDICTORS
from weberlink.codec.predictors.plane import Plane
from weberlink.codec.predictors.sphere import Sphere
from weberlink.studies.curve_figures import QualityAxis, draw_curves
from weberlink.studies.curves import Observation, curves
from weberlink.studies.evaluate.row import Row
from weberlink.studies.evaluate.sweep import Recording, Study
from weberlink.studies.moments.moment_figures import draw_force, draw_model
from weberlink.studies.moments.moments import Fit, fits, follow, longest

USUAL_WEBER = 0.10
SHOWN = ("zoh", "linear", "hybrid")
"""Whose forces over time are drawn, of those studied: more panels than these do not fit a page."""


def draw_study(study: Study, recordings: Sequence[Recording], rows: Sequence[Row], folder: Path, caption: str) -> None:
    """Write everything into an existing folder.

    Args:
        study: of which the rows are.
        recordings: its traces.
        rows: all of them.
        folder: where to.
        caption: the environment in which the rows were made.

    Raises:
        OSError: if a file cannot be written.
    """
    write_rows(rows, folder / "rows.csv")
    observed = [Observation(row.trace, row.predictor, row.weber, row.packets_per_s, row.error_rms_jnd) for row in rows]
    quality = QualityAxis("error, RMS [JND]", better="lower", column="error_rms_jnd")
    title = recordings[0].name if len(recordings) == 1 else f"{len(recordings)} traces"
    told = f"A JND is {100 * study.jnd:g} % of the force, at least {study.floor:g} N.\n{caption}"
    draw_curves(curves(observed), folder, quality=quality, caption=told, title=title, units="traces")
    weber = min(study.webers, key=lambda weber: abs(weber - USUAL_WEBER))
    _draw_moment(study, recordings[0], weber, folder / "force", caption)
    _draw_model(study, recordings, weber, folder / "model", caption)


def write_rows(rows: Sequence[Row], path: Path) -> None:
    """All rows, flat; a cell is empty where a figure does not apply."""
    flat = [_flat(row) for row in rows]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(dict.fromkeys(key for row in flat for key in row)), lineterminator="\n")
        writer.writeheader()
        writer.writerows(flat)


def _flat(row: Row) -> dict[str, Any]:
    document = row.as_json()
    selected = document.pop("selected", {})
    return document | {f"selected_{name}": sends for name, sends in selected.items()}


def _draw_moment(study: Study, recording: Recording, weber: float, stem: Path, caption: str) -> None:
    """A second of the first trace."""
    shown = [name for name in SHOWN if name in study.predictors] or study.predictors[:3]
    runs = [follow(recording.trace, study.channel(name, weber)) for name in shown]
    draw_force(runs, stem, title=f"Force over time, {recording.name}, k = {weber:g}", caption=caption)


def _draw_model(study: Study, recordings: Sequence[Recording], weber: float, stem: Path, caption: str) -> None:
    """The surface that held longest on the first trace that had one; no figure where there is none."""
    fitting = [name for name in reversed(study.predictors) if _fits_surfaces(name)]
    for recording in recordings:
        for name in fitting[:1]:
            channel = study.channel(name, weber)
            fit = _longest_surface(fits(recording.trace, channel))
            if fit is not None:
                title = f"Fitted surface, {recording.name}, {name}, k = {weber:g}"
                draw_model(recording.trace, channel, fit.newest.tick, stem, title=title, caption=caption)
                return


def _fits_surfaces(predictor: str) -> bool:
    return predictor not in PREDICTORS or PREDICTORS[predictor].geometric


def _longest_surface(candidates: Sequence[Fit]) -> Fit | None:
    kinds = (longest(candidates, kind) for kind in (Plane, Sphere))
    return max((fit for fit in kinds if fit is not None), key=lambda fit: fit.ticks, default=None)
