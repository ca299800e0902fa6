"""The figure beside the page. Needs matplotlib (extra: plots)."""

from collections.abc import Callable, Sequence
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FormatStrFormatter, NullLocator

from weberlink.studies.adaptive.coding import RateRow
from weberlink.studies.adaptive.comparison import GroupFigures, SignalRatios, ratios
from weberlink.studies.adaptive.document import summary
from weberlink.studies.adaptive.signals import BASE_HZ
from weberlink.studies.curves import Band
from weberlink.studies.evaluate.by_source import MOST
from weberlink.studies.sheet import dot, save, sheet

MEAN, SIGNAL, LOST, LIMIT = "#0072B2", "0.6", "#D55E00", "0.3"
ROW_CM = 0.66
APART = 0.17
"""Of a row, between its signals and their mean."""
LEGEND = 2.2
"""Height of the legend [rows]."""
TICKS = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0)
PANELS: tuple[tuple[str, Callable[[SignalRatios], float], Callable[[GroupFigures], Band], float], ...] = (
    ("over the hybrid", lambda one: one.over_hybrid, lambda one: one.over_hybrid, 1.0),
    ("over the best single predictor", lambda one: one.over_best, lambda one: one.over_best, MOST),
)


def draw(rows: Sequence[RateRow], folder: Path, caption: str) -> None:
    """Write `packets.png` and `packets.svg`.

    Raises:
        OSError: if a file cannot be written.
    """
    save(packets(rows, caption), folder / "packets")


def packets(rows: Sequence[RateRow], caption: str) -> Figure:
    """A row for each group, a grey dot for each signal, the mean with its interval."""
    rates = {row.rate_hz for row in rows}
    rate = BASE_HZ if BASE_HZ in rates else min(rates)
    groups = summary(rows, rate)
    place = {one.name: row for row, one in enumerate(groups)}
    found = [one for one in ratios(rows) if one.rate_hz == rate]
    kinds = {one.group: one.kind for one in found}
    edges = [row for row in range(1, len(groups)) if kinds.get(groups[row].name) != kinds.get(groups[row - 1].name)]
    figure = sheet(2.4 + ROW_CM * (len(groups) + LEGEND), f"Packets of adaptive at {rate} Hz, by signal", caption)
    axes = figure.subplots(1, len(PANELS), sharex=True, sharey=True)
    for each, (name, of_signal, of_group, limit) in zip(axes, PANELS, strict=True):
        for one in found:
            colour = LOST if one.lost and limit > 1.0 else SIGNAL
            each.plot(of_signal(one), place[one.group] - APART, "o", color=colour, markersize=3.4, markeredgewidth=0.0)
        for group in groups:
            mean, low, high = of_group(group)
            row = place[group.name] + APART
            each.plot([low, high], [row, row], "-", color=MEAN, linewidth=1.8)
            each.plot(mean, row, "D", color=MEAN, markersize=4.0)
        each.axvline(limit, color=LIMIT, linewidth=0.9, linestyle="--")
        each.set_xscale("log")
        each.xaxis.set_major_locator(FixedLocator(TICKS))
        each.xaxis.set_minor_locator(NullLocator())
        each.xaxis.set_major_formatter(FormatStrFormatter("%g"))
        each.tick_params(labelsize=8)
        each.grid(axis="x", color="0.9", linewidth=0.6)
        each.set_axisbelow(True)
        each.set_xlabel(name, fontsize=9)
        for edge in edges:
            each.axhline(edge - 0.5, color="0.7", linewidth=0.7)
    axes[0].set_yticks(range(len(groups)), [f"{one.name} ({one.signals})" for one in groups], fontsize=8.5)
    axes[0].set_ylim(len(groups) - 0.4 + LEGEND, -0.6)
    handles = [dot("a signal", "o", SIGNAL), dot("one that loses", "o", LOST), dot("mean, 95 % interval", "D", MEAN)]
    axes[0].legend(handles=handles, loc="lower left", fontsize=8, handletextpad=0.2, frameon=False)
    return figure
