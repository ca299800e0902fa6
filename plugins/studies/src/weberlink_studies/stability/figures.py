"""Figures of the stability study. Needs matplotlib (extra: studies)."""

from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from weberlink_studies.sheet import caption_below, save
from weberlink_studies.stability.verdict import CALM

if TYPE_CHECKING:
    from pandas import DataFrame

COLOURS = {"calm": "#8fd19e", "contact lost": "#f6c667", "oscillates": "#ef8a80", "failed": "#c8c8c8"}


def verdict_of(state: str) -> str:
    """The word of the legend for a state."""
    if state in CALM:
        return "calm"
    return {"lost": "contact lost", "oscillating": "oscillates", "growing": "oscillates"}.get(state, "failed")


def stability_map(systems: "DataFrame", path: Path, caption: str) -> None:
    """Schemes by column, scenes by row, stiffness over round trip in each panel: the verdict, and what is felt in %."""
    systems = systems[systems.family != "extremes"]
    families, schemes = systems.family.unique(), systems.scheme.unique()
    trips = sorted(systems.round_trip_s.unique())
    figure = Figure(figsize=(2.0 + 0.55 * len(trips) * len(schemes), 1.4 + 0.66 * len(families)), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.03, h_pad=0.02, hspace=0.0, wspace=0.0)  # type: ignore[union-attr, call-arg]
    grid = figure.subplots(len(families), len(schemes), squeeze=False)
    for line, family in zip(grid, families, strict=True):
        mine = systems[systems.family == family]
        up = sorted(mine.stiffness_n_m.unique())
        for axes, scheme in zip(line, schemes, strict=True):
            for cell in mine[mine.scheme == scheme].itertuples():
                x, y, colour = (
                    trips.index(cell.round_trip_s),
                    up.index(cell.stiffness_n_m),
                    COLOURS[verdict_of(cell.state)],
                )
                box = Rectangle((x - 0.5, y - 0.5), 1.0, 1.0, facecolor=colour, edgecolor="white", linewidth=1.0)
                axes.add_patch(box)
                text = f"{100.0 * cell.felt:.0f}" if cell.felt == cell.felt else ""  # missing is NaN
                axes.text(x, y, text, ha="center", va="center", fontsize=8.5)
            axes.set_xlim(-0.5, len(trips) - 0.5)
            axes.set_ylim(-0.5, len(up) - 0.5)
            axes.set_xticks([])
            axes.set_yticks([])
        unit = " N m/rad" if (mine.robot == "arm").all() else ""
        line[0].set_yticks(range(len(up)), [f"{value:g}".replace("e+0", "e") + unit for value in up], fontsize=8)
        line[0].set_ylabel(family, rotation=0, ha="right", va="center", fontsize=10, labelpad=8)
    for axes, scheme in zip(grid[0], schemes, strict=True):
        axes.set_title(scheme, fontsize=11, fontweight="bold")
    for axes in grid[-1]:
        axes.set_xticks(range(len(trips)), [f"{1e3 * trip:g}" for trip in trips], fontsize=8)
        axes.set_xlabel("round trip [ms]", fontsize=9)
    figure.legend(
        handles=[Patch(facecolor=colour, label=name) for name, colour in COLOURS.items()],
        loc="outside upper center", ncols=4, fontsize=9, frameon=False,
        title="number: force felt, % of the ideal; rows in a panel: stiffness [N/m]", title_fontsize=9,
    )  # fmt: skip
    caption_below(figure, caption, fontsize=7, color="0.4")
    save(figure, path.with_suffix(""), dpi=110, usual=("png",))


def stability_wall(rows: "DataFrame", path: Path, caption: str) -> None:
    """Measured stability limits of sampled walls over those of the eigenvalues, and Colgate's bound."""
    figure = Figure(figsize=(7.0, 4.4), layout="constrained")
    axes = figure.subplots()
    axes.axhspan(0.95, 1.05, color="0.88", label="5 %", linewidth=0.0)
    axes.axhline(1.0, color="0.5", linewidth=0.8)
    axes.plot(
        rows.stable_to_n_m, rows.passive_to_n_m / rows.stable_to_n_m, "_", markersize=9, color="C3",
        label="Colgate's bound: passive for any hand",
    )  # fmt: skip
    for number, (grip, mine) in enumerate(rows.groupby("grip", sort=False)):
        axes.plot(
            mine.stable_to_n_m, mine.measured_n_m / mine.stable_to_n_m, "o^s"[number % 3], markersize=6,
            fillstyle="none", color=f"C{number}", label=f"measured, {grip} grip",
        )  # fmt: skip
    axes.set_xscale("log")
    axes.set_ylim(0.0, 1.2)
    axes.set_xlabel("stable up to, by eigenvalues [N/m]")
    axes.set_ylabel("relative to the eigenvalues' limit")
    worst, wrong = rows.deviation.abs().max(), int(rows.passive_but_active.sum())
    axes.set_title(
        f"{len(rows)} sampled walls: limit off by {worst:.2%} at most; {wrong} active on the passive side", fontsize=10
    )
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="lower left")
    caption_below(figure, caption, fontsize=6, color="0.4")
    save(figure, path.with_suffix(""), dpi=110, usual=("png",))


MOST_N = 0.5  # end of the colour scale [N]: the difference of the errors


def display_map(judged: "DataFrame", path: Path, caption: str) -> None:
    """Scenes over delays, a panel for each scheme, link and hand: the felt error, coloured by its difference to that of
    the best scheme before.
    """
    panels = list(judged.groupby(["scheme", "link", "hand"], sort=False))
    columns = min(3, len(panels))
    lines = -(-len(panels) // columns)
    figure = Figure(figsize=(4.4 * columns + 0.8, 3.6 * lines + 0.6), layout="constrained")
    places = list(figure.subplots(lines, columns, squeeze=False).flat)
    mappable = ScalarMappable(Normalize(-MOST_N, MOST_N), colormaps["RdYlGn_r"])
    for axes, (title, runs) in zip(places, panels, strict=False):
        across, up = sorted(runs.delay_ms.unique()), list(runs.scene.unique())[::-1]
        for run in runs.itertuples():
            x, y, excess = across.index(run.delay_ms), up.index(run.scene), run.error_n - run.former_error_n
            colour = mappable.to_rgba(excess) if run.compared else "0.9"
            axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1.0, 1.0, facecolor=colour, edgecolor="0.8", linewidth=0.5))
            axes.text(x, y, f"{run.error_n:.2f}" + ("*" if run.ghost else ""), ha="center", va="center", fontsize=8)
        axes.set_xlim(-0.5, len(across) - 0.5)
        axes.set_ylim(-0.5, len(up) - 0.5)
        axes.set_xticks(range(len(across)), across, fontsize=8)
        axes.set_yticks(range(len(up)), up, fontsize=8)
        axes.set_xlabel("delay each way [ms]", fontsize=8)
        axes.set_title(", ".join(title), fontsize=9)
    for axes in places[len(panels) :]:
        axes.set_axis_off()
    bar = figure.colorbar(mappable, ax=places, extend="both", shrink=min(1.0, 2.0 / lines), pad=0.01)
    bar.set_label("felt error [N] minus that of the best scheme before; *: ghost", fontsize=8)
    caption_below(figure, caption, fontsize=7, color="0.4")
    save(figure, path.with_suffix(""), dpi=100, usual=("png",))
