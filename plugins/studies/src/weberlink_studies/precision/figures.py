"""The figure of the precision study. Needs matplotlib (extra: studies)."""

from collections.abc import Sequence
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from weberlink_studies.precision.problems import Problem
from weberlink_studies.sheet import caption_below, save

if TYPE_CHECKING:
    from pandas import DataFrame

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#56B4E9", "#E69F00")
"""Colours of Okabe and Ito, distinct for colour-blind readers."""
COLUMNS = 5
SHOWN = (1e-15, 30.0)
DIVERGED_AT = 8.0


def work_precision(rows: "DataFrame", problems: Sequence[Problem], path: Path, caption: str) -> None:
    """Errors over run time, a panel per problem: a solid line per integrator for position, a dotted one for force."""
    colours = dict(zip(rows.integrator.unique(), COLOURS, strict=False))
    columns = min(COLUMNS, len(problems))
    lines = ceil(len(problems) / columns)
    figure = Figure(figsize=(2.9 * columns, 2.5 * lines + 0.7), layout="constrained")
    grid = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False).ravel().tolist()
    for problem, axes in zip(problems, grid, strict=False):
        _panel(axes, rows[rows.problem == problem.name], problem, colours)
    for axes in grid[len(problems) :]:
        axes.axis("off")
    for axes in grid[max(0, len(problems) - columns) : len(problems)]:
        axes.tick_params(labelbottom=True)
        axes.set_xlabel("CPU time per simulated second [s]", fontsize=8)
    figure.legend(handles=_key(colours), loc="outside upper center", frameon=False, fontsize=9, ncols=4)
    figure.supylabel("largest error: position / extent of the motion, force / largest force", fontsize=9)
    caption_below(figure, caption, fontsize=7, color="0.4")
    save(figure, path.with_suffix(""), dpi=100, usual=("png",))


def _panel(axes: Axes, rows: "DataFrame", problem: Problem, colours: dict[str, str]) -> None:
    for name, colour in colours.items():
        mine = rows[rows.integrator == name].sort_values("step_us", ascending=False)
        times = 1e-3 * mine.run_time_ms_per_s
        errors = mine[["position_error", "force_error"]].astype(float).clip(lower=1.5 * SHOWN[0])
        errors = errors.mask(mine.diverged, axis=0)
        axes.plot(times, errors.force_error, ":", color=colour, linewidth=1.0)
        axes.plot(times, errors.position_error, "-", color=colour, linewidth=1.0)
        for fits, marker, face in ((False, "^", "white"), (True, "o", colour)):
            some = mine.substeps_per_tick.ge(1) == fits
            axes.plot(
                times[some], errors.position_error[some], marker, color=colour, markersize=3.5, markerfacecolor=face
            )
        lost = times[mine.diverged]
        axes.plot(lost, [DIVERGED_AT] * len(lost), "x", color=colour, markersize=4.5, markeredgewidth=1.2)
        chosen = mine.recommended
        axes.plot(
            times[chosen], errors.position_error.fillna(DIVERGED_AT)[chosen], "o", markersize=10,
            markerfacecolor="none", markeredgecolor="black",
        )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(*SHOWN)
    axes.grid(alpha=0.25, linewidth=0.5)
    axes.set_title(f"{problem.name}\n", fontsize=9.5, fontweight="bold")
    axes.text(0.5, 1.02, problem.about, transform=axes.transAxes, ha="center", va="bottom", fontsize=6.5)
    axes.tick_params(labelsize=8)


def _key(colours: dict[str, str]) -> list[Line2D]:
    return [
        *(Line2D([], [], color=colour, label=name) for name, colour in colours.items()),
        Line2D([], [], color="0.4", label="position"),
        Line2D([], [], color="0.4", linestyle=":", label="force"),
        Line2D([], [], color="0.4", marker="^", markerfacecolor="white", linestyle="", label="step longer than a tick"),
        Line2D([], [], color="0.4", marker="o", linestyle="", markersize=4, label="step of a tick or less, halving"),
        Line2D([], [], color="0.4", marker="x", linestyle="", label="diverged"),
        Line2D(
            [], [], color="black", marker="o", markerfacecolor="none", markersize=9, linestyle="", label="auto, 1 kHz"
        ),
    ]
