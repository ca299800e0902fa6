"""Figure of what is felt of a scene, beside the best of the schemes before. Needs matplotlib (extra: studies)."""

from pathlib import Path

from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from weberlink.studies.sheet import caption_below, save
from weberlink.studies.stability.display import Display, DisplayCell
from weberlink.studies.stability.display_study import Figures, best, is_ghost

COLUMNS = 3
MOST_N = 0.5
"""End of the colour scale [N]: the difference of the errors."""


def display_map(figures: Figures, before: Figures, path: Path, caption: str) -> None:
    """A heat map for each scheme, link and hand: scenes over delays; in each cell the error of the best scheme before
    and that of this one.

    Args:
        figures: of all cells.
        before: of the schemes before.
        path: of the picture, a PNG unless other formats are asked for.
        caption: the environment of the run, printed below.
    """
    panels: dict[tuple[str, str, str], list[tuple[DisplayCell, Display]]] = {}
    for cell, displays in figures.items():
        for name, display in displays.items():
            panels.setdefault((name, cell.link, cell.hand), []).append((cell, display))
    lines = -(-len(panels) // COLUMNS)
    figure = Figure(figsize=(5.0 * COLUMNS, 4.0 * lines + 0.8), layout="constrained")
    places = list(figure.subplots(lines, COLUMNS, squeeze=False).flat)
    mappable = ScalarMappable(Normalize(-MOST_N, MOST_N), colormaps["RdYlGn_r"])
    for axes, (title, runs) in zip(places, panels.items(), strict=False):
        _draw_panel(axes, runs, before, mappable)
        axes.set_title(", ".join(title), fontsize=9)
    for axes in places[len(panels) :]:
        axes.set_axis_off()
    bar = figure.colorbar(mappable, ax=places, extend="both", shrink=min(1.0, 2.0 / lines), pad=0.01)
    bar.set_label("error [N] minus that of the best scheme before (upper number); o: ghost", fontsize=8)
    caption_below(figure, caption, fontsize=6.5, color="0.4")
    save(figure, path.with_suffix(""), dpi=130, usual=("png",))


def _draw_panel(axes: Axes, runs: list[tuple[DisplayCell, Display]], before: Figures, mappable: ScalarMappable) -> None:
    across = sorted({cell.delay_ms for cell, _ in runs})
    up = list(dict.fromkeys(cell.scene for cell, _ in runs))[::-1]
    for cell, display in runs:
        x, y, least = across.index(cell.delay_ms), up.index(cell.scene), best(before, cell)
        error = display.error_n
        colour = "0.9" if least is None or display.failure else mappable.to_rgba(error - least)  # type: ignore[arg-type]
        axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1.0, 1.0, facecolor=colour, edgecolor="0.8", linewidth=0.5))
        text = "failed" if display.failure else f"{error:.2f}" if least is None else f"{least:.2f}\n{error:.2f}"
        axes.text(x, y, text, ha="center", va="center", fontsize=6.5)
        if is_ghost(cell, display):
            axes.plot(x + 0.38, y + 0.36, "o", color="C0", markersize=4.0, fillstyle="none")
    axes.set_xlim(-0.5, len(across) - 0.5)
    axes.set_ylim(-0.5, len(up) - 0.5)
    axes.set_xticks(range(len(across)), [str(delay) for delay in across], fontsize=7)
    axes.set_yticks(range(len(up)), up, fontsize=7)
    axes.set_xlabel("delay each way [ms]", fontsize=8)
