"""Forces over time with the sends marked, as Figs. 2 and 3 of the paper (see `weberlink_studies.paper`).

Needs matplotlib (extra: studies).
"""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from weberlink_studies.coded_trace import CodedTrace, TickWindow, interesting_window
from weberlink_studies.sheet import SENT, beside, dot, legend, save, sheet, styles

Array = NDArray[np.float64]

PANEL_CM = 5.2
DISPLAYED = "#7B3294"
MAGNITUDE = "|force| [N]"
BALL = "The deadband is a ball about the force vector: a mere change of direction can send, too."
ONE_AXIS = 0.99  # from this share of the squared force on one axis, that axis is drawn instead of the magnitude


def draw_force(
    runs: Sequence[CodedTrace],
    path_stem: Path,
    *,
    title: str,
    caption: str,
    seconds: float = 1.0,
    window: TickWindow | None = None,
) -> None:
    """Write force over time, and its numbers as CSV, in a window; by default the one that shows most."""
    window = interesting_window(runs[0], seconds) if window is None else window
    save(force_figure(runs, window, title, caption), path_stem)
    with beside(path_stem, ".csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["predictor", "t_s", "actual_n", "predicted_n", "displayed_n", "bound_n", "sent", "selected"])
        for run in runs:
            _, (actual, predicted, displayed) = quantity(run, window)
            for place, tick in enumerate(range(*window)):
                numbers = [run.trace.time_s[tick], actual[place], predicted[place], displayed[place], run.bound_n[tick]]
                row = [*(f"{number:.9g}" for number in numbers), int(run.sent[tick]), run.bank[run.selected[tick]]]
                writer.writerow([run.predictor, *row])


def force_figure(runs: Sequence[CodedTrace], window: TickWindow, title: str, caption: str) -> Figure:
    """Actual and displayed force over time, one panel for each run; at least one run, all of one trace."""
    if any(quantity(run, window)[0] == MAGNITUDE for run in runs):
        caption = f"{BALL}\n{caption}"
    figure = sheet(PANEL_CM * len(runs) + 2.2, title, caption)
    panels = figure.subplots(len(runs), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axes, run in zip(panels, runs, strict=True):
        _draw_run(axes, run, window)
    panels[-1].set_xlabel("time [s]; ticks: sends")
    legend(panels[0], _force_legend(runs), columns=4, above=1.12)
    return figure


def quantity(run: CodedTrace, window: TickWindow) -> tuple[str, tuple[Array, Array, Array]]:
    """Label, then actual, predicted and displayed force [N] in the window.

    The axis with nearly all of the force, with its sign; else the magnitude.
    """
    drawn = slice(*window)
    energies = (run.trace.force_n**2).sum(axis=0)
    axis = int(np.argmax(energies))
    forces = run.trace.force_n[drawn], run.predicted_n[drawn], run.displayed_n[drawn]
    if energies[axis] >= ONE_AXIS * energies.sum():
        return f"force along {'xyz'[axis]} [N]", (forces[0][:, axis], forces[1][:, axis], forces[2][:, axis])
    actual, predicted, displayed = (np.linalg.norm(force, axis=1) for force in forces)
    return MAGNITUDE, (actual, predicted, displayed)


def _draw_run(axes: Any, run: CodedTrace, window: TickWindow) -> None:
    drawn = slice(*window)
    time, bound, sent = run.trace.time_s[drawn], run.bound_n[drawn], run.sent[drawn]
    label, (actual, predicted, displayed) = quantity(run, window)
    axes.fill_between(time, actual - bound, actual + bound, color="0.82", linewidth=0.0, label="deadband")
    axes.plot(time, actual, color="black", linewidth=0.9, label="actual")
    # At a send, the displayed force jumps from the prediction to the sample within one tick.
    axes.plot(
        np.repeat(time, 2), np.column_stack([predicted, displayed]).ravel(),
        color=DISPLAYED, linewidth=1.3, label="displayed", zorder=3,
    )  # fmt: skip
    for name, style in styles(run.bank).items():
        mine = sent & (run.selected[drawn] == run.bank.index(name))
        marker, colour = (style.marker, style.colour) if len(run.bank) > 1 else ("o", SENT)
        axes.plot(
            time[mine], displayed[mine], marker, color=colour, markersize=4.5, markeredgecolor="white",
            markeredgewidth=0.5, zorder=4, label=f"sent {name}",
        )  # fmt: skip
    (ticks,) = axes.plot(
        time[sent], np.zeros(sent.sum()), "|", color=SENT, markersize=9, transform=axes.get_xaxis_transform(),
        clip_on=False, zorder=5, label="ticks",
    )  # fmt: skip
    ticks.set_in_layout(False)  # without a send it would have a place far from the axes
    axes.set_ylabel(label)
    axes.set_xlim(time[0], time[-1])
    axes.grid(alpha=0.3, linewidth=0.6)
    length = len(time) * float(np.median(np.diff(run.trace.time_s)))
    axes.set_title(f"{run.predictor}: {sent.sum()} sends in {length:g} s", loc="left", fontsize=9.5, fontweight="bold")


def _force_legend(runs: Sequence[CodedTrace]) -> list[Any]:
    entries: list[Any] = [
        Line2D([], [], color="black", linewidth=0.9, label="actual"),
        Line2D([], [], color=DISPLAYED, linewidth=1.3, label="displayed"),
        Patch(facecolor="0.82", label="deadband"),
    ]
    if any(len(run.bank) == 1 for run in runs):
        entries.append(dot("sent", "o", SENT))
    chosen = dict.fromkeys(name for run in runs if len(run.bank) > 1 for name in run.bank)
    return entries + [dot(f"hybrid: {name}", style.marker, style.colour) for name, style in styles(chosen).items()]
