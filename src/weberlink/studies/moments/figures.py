"""Figures of a moment: forces over time with the sends marked, and the fitted model in use.

As Figs. 2, 3 and 6 of Xu, Kammerl, Chaudhari and Steinbach, "Hybrid signal-based and geometry-based prediction for
haptic data reduction", HAVE 2011. Needs matplotlib (extra: plots).
"""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from weberlink.slave.scenes.scene import Scene
from weberlink.studies.moments.moments import CodedTrace, TickWindow, interesting_window
from weberlink.studies.moments.portrait import Portrait, portrait
from weberlink.studies.sheet import SENT, beside, dot, footer_cm, legend, save, sheet, styles

Array = NDArray[np.float64]

PANEL_CM = 5.2
DISPLAYED = "#7B3294"
MAGNITUDE = "|force| [N]"
BALL = "The deadband is a ball about the force vector: a mere change of direction can send, too."
MODEL_CM = 16.0
LEAST_ROOM_MM = 1.0
ARROW = "#D55E00"
ONE_AXIS = 0.99
"""From this share of the squared force on one axis, that axis is drawn instead of the magnitude."""


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


def draw_model(
    run: CodedTrace, tick: int, path_stem: Path, scene: Scene | None = None, *, title: str, caption: str
) -> None:
    """Write the model in use at a tick, and its numbers and parameters as CSV.

    Args:
        scene: in which the trace was made, in its frame; None if unknown.

    Raises:
        ValueError: there is no model at the tick, or one without a surface.
    """
    drawn = portrait(run.trace, run.fit_at(tick), tick, scene)
    save(model_figure(drawn, title, caption), path_stem)
    drawn.write_csv(beside(path_stem, ".csv"), beside(path_stem, "_parameters.csv"))


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


def model_figure(drawn: Portrait, title: str, caption: str) -> Figure:
    """The fitted surface in the scene: a 3-D view, a section along the trajectory, and the parameters."""
    below = footer_cm(caption)
    figure = sheet(MODEL_CM, title, caption)
    figure.set_layout_engine("none")  # it reserves no room for the labels of 3-D axes

    def place(left: float, bottom: float, width: float, height: float) -> tuple[float, float, float, float]:
        """Shares of the width; cm above the footer."""
        return left, (below + bottom) / (MODEL_CM + below), width, height / (MODEL_CM + below)

    with rc_context({"grid.color": "0.85", "grid.linewidth": 0.5}):
        space = figure.add_axes(place(0.03, 6.9, 0.94, 8.0), projection="3d", computed_zorder=False)
    _draw_space(space, drawn)
    _draw_section(figure.add_axes(place(0.10, 2.3, 0.40, 4.0)), drawn)
    figure.text(
        *place(0.565, 6.3, 0.0, 0.0)[:2], _table(drawn), family="monospace", fontsize=8, va="top", linespacing=1.25
    )
    figure.legend(
        handles=_model_legend(drawn), loc="lower center", bbox_to_anchor=place(0.5, 0.05, 0.0, 0.0), ncols=3,
        fontsize=8.5, frameon=False, handlelength=2.2, columnspacing=1.4,
    )  # fmt: skip
    return figure


def _draw_space(axes: Any, drawn: Portrait) -> None:
    if drawn.scene_patch_m is not None:
        x, y, z = 1e3 * np.moveaxis(drawn.scene_patch_m, -1, 0)
        axes.plot_wireframe(x, y, z, color="0.55", linewidth=0.4, rcount=x.shape[0], ccount=x.shape[1], zorder=1)
    x, y, z = 1e3 * np.moveaxis(drawn.patch_m, -1, 0)
    axes.plot_surface(x, y, z, color=_colour(drawn), alpha=0.40, linewidth=0.0, shade=False, zorder=2)
    axes.plot(*(1e3 * drawn.positions_m.T), color="black", linewidth=1.2, zorder=3)
    length = _arrow_mm_n(drawn)
    for position, force, marked in _marked(drawn):
        start = [1e3 * one for one in position]
        axes.quiver(
            *start, *(length * one for one in force), color=ARROW, linewidth=1.4, arrow_length_ratio=0.2, zorder=4
        )
        axes.plot(*([one] for one in start), linestyle="", zorder=5, **marked)
    axes.set_xlabel("x [mm]", fontsize=9, labelpad=-1)
    axes.set_ylabel("y [mm]", fontsize=9, labelpad=-1)
    axes.set_zlabel("z [mm]", fontsize=9, labelpad=-5)
    axes.tick_params(labelsize=8, pad=-1)
    spans = [float(np.ptp(limits)) for limits in (axes.get_xlim(), axes.get_ylim(), axes.get_zlim())]
    axes.set_box_aspect(spans, zoom=1.4 - 0.4 * spans[2] / max(spans))  # a flat box leaves room
    for axis, span in zip((axes.xaxis, axes.yaxis, axes.zaxis), spans, strict=True):
        axis.set_major_locator(MaxNLocator(max(1, round(6.0 * span / max(spans))), steps=[1, 2, 5, 10]))
        axis.set_pane_color((0.97, 0.97, 0.97))
    axes.view_init(elev=26, azim=_azimuth(drawn))


def _azimuth(drawn: Portrait) -> float:
    """View from the side of the path that the surface faces, turned by 20 deg."""
    aside, normal = drawn.frame.across, drawn.frame.normal
    facing = aside[0] * normal[0] + aside[1] * normal[1]
    sign = 1.0 if facing > 1e-6 or (abs(facing) <= 1e-6 and aside[1] < 0.0) else -1.0
    return float(np.degrees(np.arctan2(sign * aside[1], sign * aside[0]))) + 20.0


def _draw_section(axes: Any, drawn: Portrait) -> None:
    """Section along the path and the normal; heights are enlarged to fill the panel."""
    path = 1e3 * drawn.frame.coordinates(drawn.positions_m)
    low, high = float(path[:, 0].min()), float(path[:, 0].max())
    room = max(0.12 * (high - low), LEAST_ROOM_MM)
    across = np.linspace(low - room, high + room, 200)
    for heights, style in (
        (drawn.scene_section(1e-3 * across), {"color": "0.45", "linewidth": 2.6}),
        (drawn.fitted_section(1e-3 * across), {"color": _colour(drawn), "linewidth": 1.4, "linestyle": "--"}),
    ):
        if heights is not None:
            axes.plot(across, 1e3 * heights, **style)
    axes.plot(path[:, 0], path[:, 2], color="black", linewidth=1.0)
    for position, _, marked in _marked(drawn):
        u, _, height = 1e3 * drawn.frame.coordinates(np.array([position]))[0]
        axes.plot(u, height, linestyle="", **marked)
    axes.set_xlabel("along the path [mm]", fontsize=9)
    axes.set_ylabel("along the normal [mm]", fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.3, linewidth=0.6)


def _table(drawn: Portrait) -> str:
    """The parameters, fitted and of the scene."""
    lines = [f"{'':<20}{'fitted':>8}{'scene' if drawn.scene is not None else '':>9}".rstrip()]
    for one in drawn.parameters:
        name = f"{one.name} [{one.unit}]" if one.unit else one.name
        true = f"{_short(one.scene):>9}" if one.scene is not None else ""
        lines.append(f"{name:<20}{_short(one.fitted):>8}{true}")
    return "\n".join(lines)


def _colour(drawn: Portrait) -> str:
    return styles([drawn.fit.predictor])[drawn.fit.predictor].colour


def _marked(drawn: Portrait) -> list[tuple[Any, Any, dict[str, Any]]]:
    """Position, force and marker of the samples and of the tick shown."""
    points: list[tuple[Any, Any, dict[str, Any]]] = [
        (sample.position, sample.value, {"marker": "o", "color": SENT, "markersize": 6.0}) for sample in drawn.samples
    ]
    moment = {"marker": "*", "color": "black", "markersize": 9.0}
    points.append((drawn.positions_m[drawn.place].tolist(), drawn.forces_n[drawn.place].tolist(), moment))
    return points


def _arrow_mm_n(drawn: Portrait) -> float:
    """Length of an arrow for 1 N: a round number, so that the longest is about 30 % of the patch."""
    most = max(float(np.linalg.norm(force)) for _, force, _ in _marked(drawn))
    points = drawn.patch_m.reshape(-1, 3)
    size = 1e3 * float((np.nanmax(points, axis=0) - np.nanmin(points, axis=0)).max())
    wanted = 0.30 * size / most
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= wanted))


def _model_legend(drawn: Portrait) -> list[Any]:
    concave = drawn.surface.radius < 0.0
    label = f"fitted {drawn.fit.predictor}{', concave: r < 0' if concave else ''}"
    entries: list[Any] = [Patch(facecolor=_colour(drawn), alpha=0.45, label=label)]
    if drawn.scene_patch_m is not None:
        entries.append(Line2D([], [], color="0.55", linewidth=1.0, label="surface of the scene"))
    return [
        *entries,
        Line2D([], [], color="black", linewidth=1.2, label="probe, model in force"),
        dot("the samples it was fitted to", "o", SENT, 6.0),
        dot(f"the moment, tick {drawn.tick}", "*", "black", 9.0),
        dot(f"force, 1 N = {_arrow_mm_n(drawn):g} mm", r"$\uparrow$", ARROW, 9.0),
    ]


def _short(number: float) -> str:
    if number in (float("inf"), float("-inf")):
        return "flat"
    text = f"{number:.3f}" if abs(number) < 10.0 else f"{number:.1f}"
    return text.replace("-0.000", "0.000")
