"""The figures of `weberlink study paper`: curves of every condition, and forces over time of one scene."""

from pathlib import Path
from typing import TYPE_CHECKING

from weberlink.codec import Channel
from weberlink.master.trace import Trace
from weberlink_studies.coded_trace import CodedTrace
from weberlink_studies.curve_figures import QualityAxis, draw_over_rate, draw_over_weber, handles
from weberlink_studies.curves import RATE, curves
from weberlink_studies.force_figure import draw_force
from weberlink_studies.sheet import save, sheet

if TYPE_CHECKING:
    from collections.abc import Callable

    from pandas import DataFrame

QUALITY = QualityAxis("error_rms_jnd", "RMS error [JND]", "lower")
COLUMNS = 2
PANEL_CM = 6.3


def draw_curves(rows: "DataFrame", folder: Path, caption: str) -> None:
    """Write Figs. 7 and 9: a panel for each source of recordings with a surface, and for all scenes of a condition."""
    means = {
        title: curves(part.rename(columns={"signal": "unit"}), QUALITY.column, resamples=0)
        for title, part in rows.groupby("panel", sort=False)
    }
    count = -(-(len(means) + 1) // COLUMNS)  # one more for the legend
    for name, title in (("packet_rate", "Packets over Weber factor"), ("quality_over_rate", "Error over packets")):
        figure = sheet(PANEL_CM * count, f"{title}: means over signals", caption)
        panels = figure.subplots(count, COLUMNS, squeeze=False).ravel()
        for axes, (panel, found) in zip(panels, means.items(), strict=False):
            axes.set_title(panel, fontsize=9)
            axes.tick_params(labelsize=8)
            if name == "packet_rate":
                draw_over_weber(axes, found, RATE)
            else:
                draw_over_rate(axes, found, QUALITY)
                axes.set_ylabel(f"{QUALITY.label}, reversed")
        for axes in panels[len(means) :]:
            axes.set_axis_off()
        panels[-1].legend(handles=handles(next(iter(means.values()))), loc="center", handlelength=4.0, frameon=False)
        save(figure, folder / name, dpi=110, usual=("png",))


def draw_forces(trace: Trace, channel: "Callable[[str], Channel]", stem: Path, caption: str) -> None:
    """Write Figs. 2 and 3 of one signal."""
    runs = [CodedTrace(trace, channel(name)) for name in ("zoh", "linear")]
    draw_force(runs, stem, title="Force over time, hold and linear prediction", caption=caption)
