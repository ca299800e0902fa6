"""Figures of an evaluation. Needs matplotlib (extra: plots), which nothing else imports."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from evaluation.traces import Row


def packet_rate(rows: Sequence[Row], path: Path, caption: str) -> None:
    """Packets per second over the Weber factor, one line per predictor: the mean over traces, each trace as a dot.

    Args:
        rows: of any number of traces.
        path: of the picture; its suffix names the format.
        caption: the environment in which the rows were made, printed below.
    """
    figure = Figure(figsize=(7.0, 4.8), layout="constrained")
    axes = figure.add_subplot()
    for predictor in dict.fromkeys(row.predictor for row in rows):
        mine = [row for row in rows if row.predictor == predictor]
        webers = sorted({row.weber for row in mine})
        rates = [[row.packets_per_s for row in mine if row.weber == weber] for weber in webers]
        (line,) = axes.plot(webers, [sum(rate) / len(rate) for rate in rates], marker="o", label=predictor)
        for weber, rate in zip(webers, rates, strict=True):
            axes.plot([weber] * len(rate), rate, ".", color=line.get_color(), alpha=0.3, markersize=4)
    axes.set_xlabel("Weber factor k")
    axes.set_ylabel("packets per second")
    axes.set_ylim(bottom=0.0)
    names = sorted({row.trace for row in rows})
    axes.set_title(f"Packet rate, {names[0] if len(names) == 1 else f'mean over {len(names)} traces'}")
    axes.grid(alpha=0.3)
    axes.legend()
    figure.supxlabel(caption, fontsize=5.5, color="0.4")
    figure.savefig(path, dpi=150)
