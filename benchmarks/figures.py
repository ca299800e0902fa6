"""Figure of a run. Needs matplotlib (extra: studies)."""

from collections.abc import Sequence
from pathlib import Path
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from benchmarks.lateness import Lateness
from weberlink_studies.sheet import caption_below, save

COLOURS = {"master": "#0072B2", "slave": "#D55E00"}
"""Colours of Okabe and Ito, distinct for colour-blind readers; the limit is black and dashed."""
LEAST_US = 1.0
STEPS_PER_DECADE = 400
WIDTH_IN = 10.0
CAPTION_PT, CAPTION_LINE = 7, 150


def lateness_figure(rates: Sequence[Lateness], path: Path, caption: str) -> None:
    """Share of ticks that are later than the abscissa, a panel for each rate; daemons beside the limit."""
    figure = Figure(figsize=(WIDTH_IN, 4.4), layout="constrained")
    panels = figure.subplots(1, len(rates), sharex=True, sharey=True, squeeze=False).ravel().tolist()
    for axes, rate in zip(panels, rates, strict=True):
        _panel(axes, rate)
    panels[0].set_xlim(left=LEAST_US)  # shared, so once all is drawn
    panels[0].set_ylim(top=1.5)
    panels[0].set_ylabel("share of ticks that are later")
    panels[0].legend(fontsize=8, loc="lower left")
    figure.suptitle("Lateness of a tick, beside a thread that only waits", fontsize=11)
    caption_below(figure, caption, _wrapped(caption), fontsize=CAPTION_PT, color="0.3")
    save(figure, path.with_suffix(""), dpi=160, usual=("png",))


def _panel(axes: Axes, rate: Lateness) -> None:
    curves = [(name, side.lateness_us, COLOURS[name], "-") for name, side in rate.sides.items()]
    for name, values, colour, line in [*curves, (rate.limit.name, rate.limit.lateness_us, "black", "--")]:
        axes.plot(*exceedance(values), color=colour, linestyle=line, linewidth=1.5, label=name, drawstyle="steps-pre")
    axes.axvline(1e6 / rate.rate_hz, color="0.6", linewidth=0.8)
    _note(axes, "one period", (1e6 / rate.rate_hz, 1.0), rotation=90)
    axes.set(xscale="log", yscale="log")
    for name, share in (("p99", 1e-2), ("p99.9", 1e-3)):
        axes.axhline(share, color="0.6", linewidth=0.8)
        axes.text(0.01, share, name, transform=axes.get_yaxis_transform(), va="bottom", fontsize=7)
    axes.set_title(f"{rate.rate_hz / 1e3:g} kHz", fontsize=10)
    axes.set_xlabel("lateness of a tick [us]", fontsize=9)
    axes.grid(which="major", alpha=0.3)
    axes.tick_params(labelsize=8)


def _note(axes: Axes, text: str, at: tuple[float, float], *, rotation: float) -> None:
    axes.annotate(
        text, at, (-2, -2), textcoords="offset points", rotation=rotation, ha="right", va="top", fontsize=7, color="0.4"
    )


def exceedance(values: ArrayLike) -> tuple[list[float], list[float]]:
    """Abscissas, and the shares of values that are at least as large; the axis begins at `LEAST_US`.

    Values are rounded to what can be seen, because more points would only take time to draw.
    """
    decades = np.log10(np.maximum(np.asarray(values, dtype=np.float64), LEAST_US))
    ordered = 10.0 ** (np.sort(np.round(decades * STEPS_PER_DECADE)) / STEPS_PER_DECADE)
    firsts = np.flatnonzero(np.diff(ordered, prepend=-np.inf))
    return ordered[firsts].tolist(), (1.0 - firsts / len(ordered)).tolist()


def _wrapped(caption: str) -> str:
    return "\n".join(fill(line, CAPTION_LINE) for line in caption.splitlines())
