"""Figures of the stability map. Needs matplotlib (extra: studies)."""

from collections.abc import Callable, Sequence
from math import ceil, log
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from weberlink.studies.sheet import caption_below, save
from weberlink.studies.stability.cells import COUPLING_N_M, SystemCell
from weberlink.studies.stability.survey import WallRow
from weberlink.studies.stability.verdict import CellVerdict

Judged = tuple[SystemCell, CellVerdict]
Quantity = Callable[[SystemCell], float | str]

COLUMNS = 4
LEAST_J, MOST_J = 1e-4, 10.0
"""Ends of the colour scale; smaller values are white."""

TRIP: tuple[str, Quantity] = ("round trip [ms]", lambda cell: 1e3 * cell.round_trip_s)
MASS: tuple[str, Quantity] = ("mass [kg]", lambda cell: cell.mass_kg)
STIFFNESS: tuple[str, Quantity] = ("stiffness [N/m]", lambda cell: cell.stiffness_n_m)
SCHEME: tuple[str, Quantity] = ("scheme", lambda cell: cell.scheme)
CASE: tuple[str, Quantity] = ("", lambda cell: cell.case)
AXES: dict[str, tuple[str, Quantity, str, Quantity]] = {
    "walls": (*TRIP, *STIFFNESS),
    "hands": ("hand", lambda cell: cell.grip, *STIFFNESS),
    "contacts": (*TRIP, *CASE),
    "extremes": (*SCHEME, *CASE),
    "rates": ("tick rate [Hz]", lambda cell: cell.rate_hz, *STIFFNESS),
    "masses": (*MASS, "damping [N s/m]", lambda cell: cell.damping_n_s_m),
    "loss": (*TRIP, "loss [%]", lambda cell: 100.0 * cell.loss),
    "far hands": (*MASS, *STIFFNESS),
    "weber": (*TRIP, "Weber factor k", lambda cell: cell.weber),
}
"""Abscissa and ordinate of each slice; words stand in the order in which they come."""


def stability_wall(rows: Sequence[WallRow], path: Path, caption: str) -> None:
    """Left: measured stability limits over those of the eigenvalues. Right: active and passive walls.

    Args:
        rows: of a survey.
        path: of the picture, a PNG unless other formats are asked for.
        caption: the environment of the run, printed below.
    """
    figure = Figure(figsize=(11.0, 5.0), layout="constrained")
    limits, energies = figure.subplots(1, 2)
    _draw_limits(limits, rows)
    _draw_activity(energies, rows)
    caption_below(figure, caption, fontsize=5.5, color="0.4")
    save(figure, path.with_suffix(""), dpi=150, usual=("png",))


def stability_map(verdicts: Sequence[Judged], path: Path, caption: str) -> None:
    """A heat map for each slice and control: energy that the operator got out since the press.

    In each cell, the force felt and the force on the robot while holding, in percent of that on the ideal local wall.

    Args:
        verdicts: of all cells.
        path: of the picture, a PNG unless other formats are asked for.
        caption: the environment of the run, printed below.
    """
    panels: dict[tuple[str, ...], list[Judged]] = {}
    for cell, verdict in verdicts:
        panels.setdefault((cell.slice, _title(cell)), []).append((cell, verdict))
    lines = ceil(len(panels) / COLUMNS)
    figure = Figure(figsize=(4.0 * COLUMNS, 3.0 * lines + 1.2), layout="constrained")
    grid = figure.subplots(lines, COLUMNS, squeeze=False)
    mappable = ScalarMappable(LogNorm(LEAST_J, MOST_J), colormaps["YlOrRd"].with_extremes(under="white"))
    places = list(grid.flat)
    for axes, ((name, title), judged) in zip(places, panels.items(), strict=False):
        _draw_panel(axes, name, judged, mappable)
        axes.set_title(title, fontsize=9)
    for axes in places[len(panels) :]:
        axes.set_axis_off()
    bar = figure.colorbar(mappable, ax=places, extend="both", shrink=min(1.0, 2.0 / lines), pad=0.01)
    bar.set_label("energy out since the press [J]", fontsize=8)
    _explain(figure)
    caption_below(figure, caption, fontsize=6.5, color="0.4")
    save(figure, path.with_suffix(""), dpi=130, usual=("png",))


def _title(cell: SystemCell) -> str:
    """Scheme, and what the cells of a panel share beside it."""
    coding = "uncoded" if cell.position_predictor == "zoh" else ""
    shared = {
        "walls": cell.variant,
        "hands": "" if coding else f"{1e3 * cell.round_trip_s:g} ms",
        "contacts": f"{_number(cell.stiffness_n_m)} N/m",
        "extremes": "",
    }
    words = ("extremes" if cell.slice == "extremes" else cell.scheme, coding, shared.get(cell.slice, cell.variant))
    return ", ".join(dict.fromkeys(filter(None, words)))


def _draw_limits(axes: Axes, rows: Sequence[WallRow]) -> None:
    axes.axhspan(0.95, 1.05, color="0.88", label="5 %", linewidth=0.0)
    axes.axhline(1.0, color="0.5", linewidth=0.8)
    axes.plot(
        [row.stable_to_n_m for row in rows],
        [row.passive_to_n_m / row.stable_to_n_m for row in rows],
        linestyle="none", marker="_", markersize=9, color="C3", label="Colgate's bound: passive for any hand",
    )  # fmt: skip
    for number, kind in enumerate(sorted({_kind(row) for row in rows})):
        mine = [row for row in rows if _kind(row) == kind]
        axes.plot(
            [row.stable_to_n_m for row in mine],
            [row.measured_n_m / row.stable_to_n_m for row in mine],
            linestyle="none", marker="o+x^s"[number % 5], markersize=6, fillstyle="none",
            color=f"C{(0, 1, 2, 4, 5)[number % 5]}", label=f"measured, {kind}",
        )  # fmt: skip
    axes.set_xscale("log")
    axes.set_ylim(0.0, 1.2)
    axes.set_xlabel("stable up to, by eigenvalues [N/m]")
    axes.set_ylabel("relative to the eigenvalues' limit")
    worst = max(abs(row.deviation) for row in rows)
    axes.set_title(f"Stability limit of {len(rows)} sampled walls: off by {100 * worst:.2f} % at most", fontsize=10)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="lower left")


def _kind(row: WallRow) -> str:
    wall = row.wall
    extras = [f"delay {wall.delay_ticks} T"]
    if wall.hand_stiffness_n_m > 1.0:
        extras.append(f"hand {wall.hand_stiffness_n_m:g} N/m")
    if wall.wall_damping_n_s_m:
        extras.append("damped wall")
    return ", ".join(extras)


def _draw_activity(axes: Axes, rows: Sequence[WallRow]) -> None:
    ends = [min(row.passive_to_n_m for row in rows), max(row.passive_to_n_m for row in rows)]
    axes.plot(ends, ends, color="C3", linewidth=1.0, label="Colgate's bound")
    for active, colour in ((False, "C0"), (True, "C1")):
        points = [
            (row.passive_to_n_m, stiffness)
            for row in rows
            for stiffness, energy in row.activities
            if (energy > 0.0) == active
        ]
        label = f"{'active' if active else 'passive'}: {len(points)} cells"
        axes.plot([x for x, _ in points], [y for _, y in points], ".", color=colour, alpha=0.6, label=label)
    axes.plot(
        [row.passive_to_n_m for row in rows],
        [row.measured_n_m for row in rows],
        linestyle="none", marker="x", markersize=6, color="0.1", label="unstable from here on, measured",
    )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("(b - B) / (T/2 + delay) [N/m]")
    axes.set_ylabel("stiffness [N/m]")
    wrong = sum(row.passive_but_active for row in rows)
    axes.set_title(f"Closed motions over the wall: {wrong} active cells on the passive side", fontsize=10)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="upper left")


def _draw_panel(axes: Axes, name: str, judged: Sequence[Judged], mappable: ScalarMappable) -> None:
    x_label, x_of, y_label, y_of = AXES[name]
    across, up = _ordered([x_of(cell) for cell, _ in judged]), _ordered([y_of(cell) for cell, _ in judged])
    size = 6.5 if len(across) <= 6 else 5.0
    for cell, verdict in judged:
        _draw_cell(axes, across.index(x_of(cell)), up.index(y_of(cell)), (cell, verdict), mappable, size)
    if name in ("walls", "hands", "rates", "masses") and judged[0][0].scheme == "none":
        _draw_limit(axes, judged, across, up, x_of)
    axes.set_xlim(-0.5, len(across) - 0.5)
    axes.set_ylim(-0.5, len(up) - 0.5)
    axes.set_xticks(range(len(across)), [_number(value) for value in across], fontsize=7)
    axes.set_yticks(range(len(up)), [_number(value) for value in up], fontsize=7)
    axes.set_xlabel(x_label, fontsize=8)
    axes.set_ylabel(y_label, fontsize=8)


def _ordered(values: Sequence[float | str]) -> list[float | str]:
    """Each once: numbers by size, words from the first at the top."""
    once = dict.fromkeys(values)
    return list(once)[::-1] if any(isinstance(value, str) for value in once) else sorted(once)


def _draw_cell(axes: Axes, x: int, y: int, judged: Judged, mappable: ScalarMappable, size: float) -> None:
    cell, verdict = judged
    corner = (x - 0.5, y - 0.5)
    energy = verdict.energy_out_j
    colour = "0.9" if energy is None else mappable.to_rgba(np.asarray(energy or 0.1 * LEAST_J))
    axes.add_patch(Rectangle(corner, 1.0, 1.0, facecolor=colour, edgecolor="0.8", linewidth=0.5))
    if verdict.state in ("failed", "refused"):
        axes.text(x, y, verdict.state, ha="center", va="center", color="C0", fontsize=size)
        return
    if verdict.state in ("oscillating", "growing"):
        axes.add_patch(Rectangle(corner, 1.0, 1.0, fill=False, hatch="////", edgecolor="0.55", linewidth=0.0))
    background = {"facecolor": "w", "alpha": 0.6, "edgecolor": "none", "pad": 0.6}
    axes.text(x, y, _figures(cell, verdict), ha="center", va="center", fontsize=size, linespacing=1.1, bbox=background)
    exceeds = cell.scheme != "none" and verdict.bound_kept is False
    marks = ((bool(verdict.saturated), "^", 0.38), (verdict.state == "lost", "o", -0.38), (exceeds, "s", 0.0))
    for met, mark, place in marks:
        if met:
            colour = "C3" if mark == "s" else "C0"
            axes.plot(x + place, y + 0.36, mark, color=colour, markersize=0.55 * size, fillstyle="none", clip_on=False)


def _figures(cell: SystemCell, verdict: CellVerdict) -> str:
    lines = []
    if verdict.felt_share is not None and verdict.pressed_share is not None:
        lines = [_percent(verdict.felt_share), _percent(verdict.pressed_share)]
    if cell.slice == "contacts" and verdict.impulse_ratio is not None:
        lines.append(f"x {verdict.impulse_ratio:.2f}")
    return "\n".join(lines)


def _percent(share: float) -> str:
    return f"{round(100.0 * share) + 0}"


def _draw_limit(
    axes: Axes, judged: Sequence[Judged], across: Sequence[float | str], up: Sequence[float | str], x_of: Quantity
) -> None:
    """Draw the stability limit without coding."""
    for place, value in enumerate(across):
        cell = next(cell for cell, _ in judged if x_of(cell) == value)
        limit = cell.least_damping() if cell.slice == "masses" else cell.limits()["stable_to_n_m"]
        if cell.slice != "masses" and limit > COUPLING_N_M:
            continue  # the robot displays no stiffer wall
        numbers = np.asarray(up, dtype=np.float64)
        rows = np.log([numbers[0] / 10.0, *numbers, numbers[-1] * 10.0])  # one more row at either end
        height = float(np.interp(log(limit), rows, range(-1, len(up) + 1)))
        if -0.5 <= height <= len(up) - 0.5:
            axes.plot([place - 0.5, place + 0.5], [height, height], color="C0", linewidth=2.0)


def _explain(figure: Figure) -> None:
    figure.legend(
        handles=[
            Patch(facecolor="w", edgecolor="0.55", hatch="////", label="oscillating or growing"),
            Line2D([], [], color="w", label="numbers: % of the ideal force, felt and on the robot"),
            Line2D([], [], color="C0", linestyle="none", marker="^", fillstyle="none", label="force limited"),
            Line2D([], [], color="C0", linestyle="none", marker="o", fillstyle="none", label="contact lost"),
            Line2D([], [], color="w", label="x: impulse felt over pressed"),
            Line2D([], [], color="C3", linestyle="none", marker="s", fillstyle="none", label="bound exceeded"),
            Line2D([], [], color="C0", linewidth=2.0, label="stability limit without coding and control"),
        ],
        loc="outside upper center",
        ncols=4,
        fontsize=8,
    )  # fmt: skip


def _number(value: float | str) -> str:
    if isinstance(value, str):
        return value
    return f"{value:g}" if value < 1e4 else f"{value:.0e}".replace("e+0", "e")
