"""The figure of the precision study. Needs matplotlib (extra: studies)."""

from collections.abc import Sequence
from math import ceil
from pathlib import Path

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from weberlink.studies.precision.measurement import IntegratorRow
from weberlink.studies.precision.study import ProblemResult
from weberlink.studies.sheet import caption_below, save

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#56B4E9", "#E69F00")
"""Colours of Okabe and Ito, distinct for colour-blind readers."""
COLUMNS = 5
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
