"""The files of `weberlink study evaluate --plots`: curves over the Weber factor, forces over time."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator

from weberlink_figures.felt import ABSOLUTE_THRESHOLD_N
from weberlink_studies.coded_trace import CodedTrace, TickWindow
from weberlink_studies.curve_figures import CurveFigures, QualityAxis
from weberlink_studies.curves import curves
from weberlink_studies.evaluate.study import EvaluationStudy
from weberlink_studies.evaluate.traces import NamedTrace
from weberlink_studies.force_figure import draw_force
from weberlink_studies.result import pareto
from weberlink_studies.sheet import dot, save, sheet, styles

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
    """Write all figures into an existing folder."""
    title = traces[0].name if len(traces) == 1 else f"{len(traces)} traces"
    cost_front(rows, folder / "error_over_cost", title, caption)
    quality = QualityAxis("error_rms_jnd", "error, RMS [JND]", better="lower")
    found = curves(rows[rows.channel == "force"].rename(columns={"trace": "unit"}), quality.column)
    told = f"A JND is {100 * study.jnd:g} % of the force, at least {ABSOLUTE_THRESHOLD_N:g} N.\n{caption}"
    CurveFigures(found, quality, told, title, units="traces").write(folder)
    weber = min(study.webers, key=lambda weber: abs(weber - USUAL_WEBER))
    runs = [CodedTrace(traces[0].trace, study.channel(name, weber)) for name in study.predictors]
    heading = f"Force over time, {traces[0].name}, k = {weber:g}"
    draw_force(runs, folder / "force", title=heading, caption=caption, window=window)


def cost_front(rows: "DataFrame", stem: Path, title: str, caption: str) -> None:
    """Write the error over packets (left) and over run time (right), means over the traces, a point a Weber factor.

    Run times are medians of encode plus decode. A ring marks the Pareto front of its panel: no other point is as small
    in both figures.
    """
    labels = {"force": ("error_rms_jnd", "force, RMS [JND]"), "position": ("error_rms_mm", "position, RMS [mm]")}
    kinds = [(channel, *labels[channel]) for channel in rows.channel.unique()]
    rows = rows.assign(error_rms_mm=1e3 * rows.get("error_rms_m", np.nan))
    figure = sheet(7.0 * len(kinds) + 1.5, f"Error over packets and over run time, {title}", caption)
    grid = figure.subplots(len(kinds), 2, sharey="row", squeeze=False)
    known = styles(rows.predictor.unique())
    for line, (channel, error, label) in zip(grid, kinds, strict=True):
        mine = rows[rows.channel == channel]
        means = (
            mine.groupby(["predictor", "weber"], sort=False)[["packets_per_s", "tick_us", error]].mean().reset_index()
        )
        for axes, cost, words in zip(
            line, ("packets_per_s", "tick_us"), ("packets per second", "us per sample"), strict=True
        ):
            for name, points in means.groupby("predictor", sort=False):
                style = known[name]
                axes.plot(
                    points[cost], points[error], linestyle=style.line, marker=style.marker, color=style.colour,
                    markersize=style.size, linewidth=1.0,
                )  # fmt: skip
            best = means[pareto(means[cost], means[error])]
            axes.plot(best[cost], best[error], "o", markersize=11, markerfacecolor="none", color="0.3", linewidth=0.8)
            axes.set_xscale("log")
            axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_locator(NullLocator())
            axes.set_xlabel(words)
            axes.grid(alpha=0.3, linewidth=0.6)
        line[0].set_ylabel(label)
    handles = [
        Line2D([], [], linestyle=style.line, marker=style.marker, color=style.colour, markersize=style.size, label=name)
        for name, style in known.items()
    ]
    handles.append(dot("front", "o", "0.3", 9.0))
    handles[-1].set_markerfacecolor("none")
    figure.legend(handles=handles, loc="outside right upper", fontsize=8.5, frameon=False)
    save(figure, stem, dpi=110, usual=("png",))
