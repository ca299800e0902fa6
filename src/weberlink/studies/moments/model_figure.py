"""The picture of one fitted model: the surface in the scene, a section through both, and the parameters.

It draws what `studies.moments.portrait` gathered and computes nothing itself. Needs matplotlib (extra: plots), which
nothing else imports.
"""

from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from weberlink.codec.predictors.sphere import Sphere
from weberlink.studies.moments.portrait import Portrait
from weberlink.studies.sheet import SENT, dot, footer_cm, looks, sheet

MODEL_CM = 16.0
LEAST_ROOM_MM = 1.0
ARROW = "#D55E00"


def model_figure(drawn: Portrait, title: str, caption: str) -> Figure:
    """The fitted surface in the scene: a view in space, a section along the trajectory, the parameters."""
    below = footer_cm(caption)
    figure = sheet(MODEL_CM, title, caption)
    figure.set_layout_engine("none")  # which makes no room for labels in space

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
        handles=_model_key(drawn), loc="lower center", bbox_to_anchor=place(0.5, 0.05, 0.0, 0.0), ncols=3, fontsize=8.5,
        frameon=False, handlelength=2.2, columnspacing=1.4,
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
    axes.set_box_aspect(spans, zoom=1.4 - 0.4 * spans[2] / max(spans))  # a flat box leaves room, a cube does not
    for axis, span in zip((axes.xaxis, axes.yaxis, axes.zaxis), spans, strict=True):
        axis.set_major_locator(MaxNLocator(max(1, round(6.0 * span / max(spans))), steps=[1, 2, 5, 10]))
        axis.set_pane_color((0.97, 0.97, 0.97))
    axes.view_init(elev=26, azim=_azimuth(drawn))


def _azimuth(drawn: Portrait) -> float:
    """From the side of the path that the surface faces, turned a little, for depth [deg]."""
    aside, normal = drawn.frame.across, drawn.frame.normal
    facing = aside[0] * normal[0] + aside[1] * normal[1]
    sign = 1.0 if facing > 1e-6 or (abs(facing) <= 1e-6 and aside[1] < 0.0) else -1.0
    return float(np.degrees(np.arctan2(sign * aside[1], sign * aside[0]))) + 20.0


def _draw_section(axes: Any, drawn: Portrait) -> None:
    """Along the path and out of the surface; heights enlarged as the panel allows."""
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
    """The parameters, fitted beside those of the scene."""
    lines = [f"{'':<20}{'fitted':>8}{'scene' if drawn.scene is not None else '':>9}".rstrip()]
    for one in drawn.parameters:
        name = f"{one.name} [{one.unit}]" if one.unit else one.name
        true = f"{_short(one.scene):>9}" if one.scene is not None else ""
        lines.append(f"{name:<20}{_short(one.fitted):>8}{true}")
    return "\n".join(lines)


def _colour(drawn: Portrait) -> str:
    return looks([drawn.fit.predictor])[drawn.fit.predictor].colour


def _marked(drawn: Portrait) -> list[tuple[Any, Any, dict[str, Any]]]:
    """Position, force and marker of the samples and of the moment."""
    points: list[tuple[Any, Any, dict[str, Any]]] = [
        (sample.position, sample.value, {"marker": "o", "color": SENT, "markersize": 6.0}) for sample in drawn.samples
    ]
    moment = {"marker": "*", "color": "black", "markersize": 9.0}
    points.append((drawn.positions_m[drawn.place].tolist(), drawn.forces_n[drawn.place].tolist(), moment))
    return points


def _arrow_mm_n(drawn: Portrait) -> float:
    """Length of an arrow for 1 N: a round number that makes the longest a good part of the patch."""
    most = max(float(np.linalg.norm(force)) for _, force, _ in _marked(drawn))
    points = drawn.patch_m.reshape(-1, 3)
    size = 1e3 * float((np.nanmax(points, axis=0) - np.nanmin(points, axis=0)).max())
    wanted = 0.30 * size / most
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= wanted))


def _model_key(drawn: Portrait) -> list[Any]:
    concave = isinstance(drawn.model, Sphere) and drawn.model.radius < 0.0
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
