"""The figures of a moment: forces over time with the sends marked, and the model in force then.

As Figs. 2 and 3, and 6, of Xu, Kammerl, Chaudhari and Steinbach, "Hybrid signal-based and geometry-based prediction for
haptic data reduction", HAVE 2011. Drawing and writing are apart, so that what is drawn can be looked into. Needs
matplotlib (extra: plots), which nothing else imports.
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

from weberlink.codec import Channel
from weberlink.master.trace import Trace
from weberlink.slave.scenes.scene import Scene
from weberlink.studies.moments.model_figure import model_figure
from weberlink.studies.moments.moments import Coded, Window, interesting_window, model_at
from weberlink.studies.moments.portrait import portrait
from weberlink.studies.sheet import SENT, beside, dot, key, looks, save, sheet

Array = NDArray[np.float64]

PANEL_CM = 5.2
DISPLAYED = "#7B3294"
MAGNITUDE = "|force| [N]"
BALL = "The deadband is a ball about the force vector: a mere change of direction can send, too."
ONE_AXIS = 0.99
"""Share of the squared force on one axis from which on that axis is drawn, with its sign, and not the magnitude."""


def draw_force(
    runs: Sequence[Coded],
    path_stem: Path,
    *,
    title: str,
    caption: str,
    seconds: float = 1.0,
    window: Window | None = None,
) -> None:
    """Write force over time as PNG and SVG, and as CSV what is drawn; arguments as of `force_figure`."""
    window = window or interesting_window(runs[0], seconds)
    save(force_figure(runs, window, title, caption), path_stem)
    with beside(path_stem, ".csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["predictor", "t_s", "actual_n", "predicted_n", "displayed_n", "bound_n", "sent", "selected"])
        for run in runs:
            _, (actual, predicted, displayed) = quantity(run, window)
            for place, tick in enumerate(range(*window)):
                numbers = [run.time_s[tick], actual[place], predicted[place], displayed[place], run.bound_n[tick]]
                row = [*(f"{number:.9g}" for number in numbers), int(run.sent[tick]), run.bank[run.selected[tick]]]
                writer.writerow([run.predictor, *row])


def force_figure(runs: Sequence[Coded], window: Window, title: str, caption: str) -> Figure:
    """Force over time, actual and displayed, one panel for each run.

    Args:
        runs: of one trace, at least one.
        window: the ticks that are drawn.
        title: of the figure.
        caption: the environment in which it was made.
    """
    if any(quantity(run, window)[0] == MAGNITUDE for run in runs):
        caption = f"{BALL}\n{caption}"
    figure = sheet(PANEL_CM * len(runs) + 2.2, title, caption)
    panels = figure.subplots(len(runs), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axes, run in zip(panels, runs, strict=True):
        _draw_run(axes, run, window)
    panels[-1].set_xlabel("time [s]; ticks: sends")
    key(panels[0], _force_key(runs), columns=4, above=1.12)
    return figure


def quantity(run: Coded, window: Window) -> tuple[str, tuple[Array, Array, Array]]:
    """What is drawn of a force vector: label, then actual, predicted and displayed [N] in the window.

    The axis that carries nearly all of the force, with its sign; else the magnitude.
    """
    drawn = slice(*window)
    energies = (run.force_n**2).sum(axis=0)
    axis = int(np.argmax(energies))
    forces = run.force_n[drawn], run.predicted_n[drawn], run.displayed_n[drawn]
    if energies[axis] >= ONE_AXIS * energies.sum():
        return f"force along {'xyz'[axis]} [N]", (forces[0][:, axis], forces[1][:, axis], forces[2][:, axis])
    actual, predicted, displayed = (np.linalg.norm(force, axis=1) for force in forces)
    return MAGNITUDE, (actual, predicted, displayed)


def draw_model(
    trace: Trace, channel: Channel, tick: int, path_stem: Path, scene: Scene | None = None, *, title: str, caption: str
) -> None:
    """Write the model in force at a tick as PNG and SVG, and as CSV what is drawn and the parameters.

    Args:
        trace: a signal.
        channel: through which it is sent.
        tick: at which a `Plane` or a `Sphere` must be in force.
        path_stem: of the files .png, .svg, .csv and _parameters.csv.
        scene: in which the trace was made, in its frame; None where it is not known.
        title: of the figure.
        caption: the environment in which it was made.

    Raises:
        ValueError: if there is no model at the tick, or one without a surface.
    """
    drawn = portrait(trace, model_at(trace, channel, tick), tick, scene)
    save(model_figure(drawn, title, caption), path_stem)
    drawn.write_csv(beside(path_stem, ".csv"), beside(path_stem, "_parameters.csv"))


def _draw_run(axes: Any, run: Coded, window: Window) -> None:
    drawn = slice(*window)
    time, bound, sent = run.time_s[drawn], run.bound_n[drawn], run.sent[drawn]
    label, (actual, predicted, displayed) = quantity(run, window)
    axes.fill_between(time, actual - bound, actual + bound, color="0.82", linewidth=0.0, label="deadband")
    axes.plot(time, actual, color="black", linewidth=0.9, label="actual")
    # At a send the displayed force jumps within one tick, from what was predicted to the sample.
    axes.plot(
        np.repeat(time, 2), np.column_stack([predicted, displayed]).ravel(),
        color=DISPLAYED, linewidth=1.3, label="displayed", zorder=3,
    )  # fmt: skip
    for name, look in looks(run.bank).items():
        mine = sent & (run.selected[drawn] == run.bank.index(name))
        marker, colour = (look.marker, look.colour) if len(run.bank) > 1 else ("o", SENT)
        axes.plot(
            time[mine], displayed[mine], marker, color=colour, markersize=4.5, markeredgecolor="white",
            markeredgewidth=0.5, zorder=4, label=f"sent {name}",
        )  # fmt: skip
    axes.plot(
        time[sent], np.zeros(sent.sum()), "|", color=SENT, markersize=9, transform=axes.get_xaxis_transform(),
        clip_on=False, zorder=5, label="ticks",
    )  # fmt: skip
    axes.set_ylabel(label)
    axes.set_xlim(time[0], time[-1])
    axes.grid(alpha=0.3, linewidth=0.6)
    length = len(time) * float(np.median(np.diff(run.time_s)))
    axes.set_title(f"{run.predictor}: {sent.sum()} sends in {length:g} s", loc="left", fontsize=9.5, fontweight="bold")


def _force_key(runs: Sequence[Coded]) -> list[Any]:
    entries: list[Any] = [
        Line2D([], [], color="black", linewidth=0.9, label="actual"),
        Line2D([], [], color=DISPLAYED, linewidth=1.3, label="displayed"),
        Patch(facecolor="0.82", label="deadband"),
    ]
    if any(len(run.bank) == 1 for run in runs):
        entries.append(dot("sent", "o", SENT))
    chosen = dict.fromkeys(name for run in runs if len(run.bank) > 1 for name in run.bank)
    return entries + [dot(f"hybrid: {name}", look.marker, look.colour) for name, look in looks(chosen).items()]
