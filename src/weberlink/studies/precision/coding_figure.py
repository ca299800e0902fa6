"""The figure of a coding study. Needs matplotlib (extra: plots), which nothing else imports.

A predictor is a colour and a line, a Weber factor a marker, so that the figure can be read in grey.
"""

from collections.abc import Callable, Sequence
from itertools import cycle
from pathlib import Path
from textwrap import fill
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from weberlink.studies.precision.coding_precision import RECOMMENDED, CodingRow, CodingStudy, front

Abscissa = Callable[[CodingRow], float]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#56B4E9", "#E69F00")
"""Of Okabe and Ito: told apart by the colour-blind too."""
LINES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)))
MARKERS = ("v", "s", "o", "D", "^", "P", "X", "*")


def draw(study: CodingStudy, path: Path, caption: str) -> None:
    """Felt error over packets and over run time, all traces pooled; arguments as of `CodingStudy.draw`."""
    rows = study.pooled
    figure = Figure(figsize=(8.8, 4.8), layout="constrained")
    by_packets, by_time = figure.subplots(1, 2, sharey=True)
    _panel(by_packets, rows, lambda row: row.packets_per_s)
    _panel(by_time, rows, lambda row: row.tick_us)
    by_packets.set(xscale="log", yscale="log")
    for axis in (by_packets.xaxis, by_packets.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_formatter(NullFormatter())
    by_packets.set_xlabel("packets per second")
    by_packets.set_ylabel("felt error, RMS [N]")
    by_time.set_xlabel("run time of encode and decode per tick, median [us]")
    figure.legend(handles=_key(rows), loc="outside right center", fontsize=8)
    count = len({row.trace for row in study.rows})
    figure.suptitle(
        f"Felt error against packets and run time, {count} trace{'s' if count > 1 else ''} pooled, "
        f"updates felt {study.latency_ticks} tick{'s' if study.latency_ticks != 1 else ''} later",
        fontsize=10,
    )
    figure.supxlabel(fill(caption, 120), fontsize=7, color="0.3")
    figure.savefig(path, dpi=250)


def _panel(axes: Any, rows: Sequence[CodingRow], abscissa: Abscissa) -> None:
    points = [(abscissa(row), row.error_rms_n) for row in rows]
    best = sorted(point for point, on in zip(points, front(points), strict=True) if on)
    axes.step(*zip(*best, strict=True), where="post", color="0.8", linewidth=7.0, solid_joinstyle="round", zorder=1)
    for predictor, colour, line in _styles(rows):
        mine = [row for row in rows if row.predictor == predictor]
        axes.plot([abscissa(row) for row in mine], [row.error_rms_n for row in mine], linestyle=line, color=colour)
        for row, marker in zip(mine, cycle(MARKERS)):
            axes.plot(abscissa(row), row.error_rms_n, marker, color=colour, markersize=5.5, zorder=3)
            if (row.predictor, row.weber) == RECOMMENDED:
                axes.plot(abscissa(row), row.error_rms_n, "o", mfc="none", mec="red", markersize=16, mew=2.0, zorder=4)
    axes.grid(which="both", alpha=0.25)


def _styles(rows: Sequence[CodingRow]) -> list[tuple[str, str, Any]]:
    predictors = list(dict.fromkeys(row.predictor for row in rows))
    return list(zip(predictors, cycle(COLOURS), cycle(LINES)))


def _key(rows: Sequence[CodingRow]) -> list[Line2D]:
    webers = list(dict.fromkeys(row.weber for row in rows))
    predictor, weber = RECOMMENDED
    return [
        *(Line2D([], [], color=colour, linestyle=line, label=name) for name, colour, line in _styles(rows)),
        *(
            Line2D([], [], color="0.3", linestyle="", marker=marker, label=f"k = {weber:g}")
            for weber, marker in zip(webers, cycle(MARKERS))
        ),
        Line2D([], [], color="0.8", linewidth=7.0, label="Pareto front"),
        Line2D(
            [],
            [],
            linestyle="",
            marker="o",
            mfc="none",
            mec="red",
            markersize=12,
            mew=2.0,
            label=f"shipped: {predictor}, k = {weber:g}",
        ),
    ]
