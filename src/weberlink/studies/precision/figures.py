"""Figures of the precision study. Needs matplotlib (extra: plots)."""

from collections.abc import Callable, Sequence
from itertools import cycle
from math import ceil
from pathlib import Path
from textwrap import fill
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from weberlink.studies.precision.coding import RECOMMENDED, CodingRow, CodingStudy
from weberlink.studies.precision.measurement import IntegratorRow, front
from weberlink.studies.precision.study import ProblemResult
from weberlink.studies.sheet import caption_below, save

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#56B4E9", "#E69F00")
"""Colours of Okabe and Ito, distinct for colour-blind readers."""
COLUMNS = 5
LINES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)))
MARKERS = ("v", "s", "o", "D", "^", "P", "X", "*")
SHOWN = (1e-15, 30.0)
DIVERGED_AT = 8.0


def work_precision(results: Sequence[ProblemResult], path: Path, caption: str) -> None:
    """Position error over run time, a panel per problem, a line per integrator, a marker per step.

    Args:
        results: of the study.
        path: of the picture, a PNG unless other formats are asked for.
        caption: the environment of the measurement, printed below.
    """
    names = list(dict.fromkeys(row.integrator for result in results for row in result.rows))
    colors = dict(zip(names, COLOURS, strict=False))
    columns = min(COLUMNS, len(results))
    lines = ceil(len(results) / columns)
    figure = Figure(figsize=(2.9 * columns, 2.5 * lines + 0.5), layout="constrained")
    grid = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False).ravel().tolist()
    for result, axes in zip(results, grid, strict=False):
        panel(axes, result, colors)
    for axes in grid[len(results) :]:
        axes.axis("off")
    figure.legend(handles=key(colors), loc="outside upper center", frameon=False, fontsize=8, ncols=4)
    for index in range(len(results)):
        grid[index].tick_params(labelbottom=index + columns >= len(results), labelleft=index % columns == 0)
        if index + columns >= len(results):
            grid[index].set_xlabel("CPU time per simulated second [s]", fontsize=7.5)
    figure.supylabel("largest position error / extent of the motion", fontsize=9)
    caption_below(figure, caption, fontsize=6, color="0.4")
    save(figure, path.with_suffix(""), dpi=160, usual=("png",))


def panel(axes: Axes, result: ProblemResult, colors: dict[str, str]) -> None:
    for name, color in colors.items():
        rows = sorted((row for row in result.rows if row.integrator == name), key=lambda row: -row.step.length)
        sound = [row for row in rows if not row.diverged]
        times, errors = [row.run_time for row in sound], [visible(row.position_error) for row in sound]
        axes.plot(times, errors, "-", color=color, linewidth=1.0)
        mark(axes, [row for row in sound if not row.step.fits_tick], "^", color, filled=False)
        mark(axes, [row for row in sound if row.step.fits_tick], "o", color, filled=True)
        lost = [row.run_time for row in rows if row.diverged]
        axes.plot(lost, [DIVERGED_AT] * len(lost), "x", color=color, markersize=4.5, markeredgewidth=1.2)
    if result.recommendation is not None:
        row = result.recommendation.row
        at = DIVERGED_AT if row.diverged else visible(row.position_error)
        axes.plot([row.run_time], [at], "o", markersize=10, markerfacecolor="none", markeredgecolor="black")
    axes.axhspan(SHOWN[0], result.floor, color="0.92", linewidth=0, zorder=0)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(*SHOWN)
    axes.grid(alpha=0.25, linewidth=0.5)
    axes.set_title(f"{result.problem.name}\n", fontsize=8.5, fontweight="bold")
    axes.text(0.5, 1.02, result.problem.about, transform=axes.transAxes, ha="center", va="bottom", fontsize=6)
    axes.tick_params(labelsize=7)


def mark(axes: Axes, rows: Sequence[IntegratorRow], shape: str, color: str, *, filled: bool) -> None:
    axes.plot(
        [row.run_time for row in rows],
        [visible(row.position_error) for row in rows],
        shape,
        color=color,
        markersize=3.5,
        markerfacecolor=color if filled else "white",
    )


def visible(error: float) -> float:
    return max(error, 1.5 * SHOWN[0])


def key(colors: dict[str, str]) -> list[Artist]:
    handles: list[Artist] = [Line2D([], [], color=color, label=name) for name, color in colors.items()]
    handles += [
        Line2D([], [], color="0.4", marker="^", markerfacecolor="white", linestyle="", label="step longer than a tick"),
        Line2D([], [], color="0.4", marker="o", linestyle="", markersize=4, label="step of a tick or less, halving"),
        Line2D([], [], color="0.4", marker="x", linestyle="", label="diverged"),
        Line2D(
            [], [], color="black", marker="o", markerfacecolor="none", markersize=9, linestyle="", label="auto, 1 kHz"
        ),
        Patch(color="0.92", label="less than is resolved"),
    ]
    return handles


def coding_figure(study: CodingStudy, path: Path, caption: str) -> None:
    """Felt error over packets and over run time, all traces pooled.

    Args:
        study: of the codec.
        path: of the picture, a PNG unless other formats are asked for.
        caption: the environment of the measurement, printed below.
    """
    rows = study.pooled
    figure = Figure(figsize=(8.8, 4.8), layout="constrained")
    by_packets, by_time = figure.subplots(1, 2, sharey=True)
    _coding_panel(by_packets, rows, lambda row: row.packets_per_s)
    _coding_panel(by_time, rows, lambda row: row.tick_us)
    by_packets.set(xscale="log", yscale="log")
    for axis in (by_packets.xaxis, by_packets.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_formatter(NullFormatter())
    by_packets.set_xlabel("packets per second")
    by_packets.set_ylabel("felt error, RMS [N]")
    by_time.set_xlabel("run time of encode and decode per tick, median [us]")
    figure.legend(handles=_coding_key(rows), loc="outside right center", fontsize=8)
    count = len({row.trace for row in study.rows})
    figure.suptitle(
        f"Felt error against packets and run time, {count} trace{'s' if count > 1 else ''} pooled, "
        f"updates felt {study.latency_ticks} tick{'s' if study.latency_ticks != 1 else ''} later",
        fontsize=10,
    )
    caption_below(figure, caption, fill(caption, 120), fontsize=7, color="0.3")
    save(figure, path.with_suffix(""), dpi=250, usual=("png",))


def _coding_panel(axes: Any, rows: Sequence[CodingRow], abscissa: Callable[[CodingRow], float]) -> None:
    points = [(abscissa(row), row.error_rms_n) for row in rows]
    best = sorted(point for point, on in zip(points, front(points), strict=True) if on)
    axes.step(*zip(*best, strict=True), where="post", color="0.8", linewidth=7.0, solid_joinstyle="round", zorder=1)
    for predictor, colour, line in _styles(rows):
        mine = [row for row in rows if row.predictor == predictor]
        axes.plot([abscissa(row) for row in mine], [row.error_rms_n for row in mine], linestyle=line, color=colour)
        for row, marker in zip(mine, cycle(MARKERS)):
            axes.plot(abscissa(row), row.error_rms_n, marker, color=colour, markersize=5.5, zorder=3)
            if (row.predictor, row.weber) == RECOMMENDED:
                axes.plot(abscissa(row), row.error_rms_n, "o", mfc="none", mec="red", markersize=16, mew=2.0, zorder=4)
    axes.grid(which="both", alpha=0.25)


def _styles(rows: Sequence[CodingRow]) -> list[tuple[str, str, Any]]:
    predictors = list(dict.fromkeys(row.predictor for row in rows))
    return list(zip(predictors, cycle(COLOURS), cycle(LINES)))


def _coding_key(rows: Sequence[CodingRow]) -> list[Line2D]:
    webers = list(dict.fromkeys(row.weber for row in rows))
    predictor, weber = RECOMMENDED
    return [
        *(Line2D([], [], color=colour, linestyle=line, label=name) for name, colour, line in _styles(rows)),
        *(
            Line2D([], [], color="0.3", linestyle="", marker=marker, label=f"k = {weber:g}")
            for weber, marker in zip(webers, cycle(MARKERS))
        ),
        Line2D([], [], color="0.8", linewidth=7.0, label="Pareto front"),
        Line2D(
            [], [], linestyle="", marker="o", mfc="none", mec="red", markersize=12, mew=2.0,
            label=f"shipped: {predictor}, k = {weber:g}",
        ),
    ]  # fmt: skip
