"""Figures over Weber factors: packet rate, quality, and quality over packet rate, with confidence intervals.

As Figs. 7 to 9 of Xu, Kammerl, Chaudhari and Steinbach, "Hybrid signal-based and geometry-based prediction for haptic
data reduction", HAVE 2011.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, Literal

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

from weberlink_studies.curves import CONFIDENCE, RATE, RESAMPLES
from weberlink_studies.sheet import PlotStyle, legend, save, sheet, styles, watermark

if TYPE_CHECKING:
    from pandas import DataFrame

BODY_CM = 10.2
RATE_LABEL = "packets per second"


@dataclass(frozen=True)
class QualityAxis:
    """How the quality of the observations is drawn."""

    column: str  # its name in the curves
    label: str  # with the unit, such as "rating" or "error, RMS [JND]"
    better: Literal["higher", "lower"]  # which end is good; that end is drawn up
    # least and largest possible value, such as 0 and 5; None for those of the data
    limits: tuple[float, float] | None = None
    words: Mapping[int, str] | None = None  # of single values, written beside these on the axis; None for numbers alone


@dataclass(frozen=True)
class CurveFigures:
    """The three figures of one set of curves."""

    curves: "DataFrame"  # of `curves`, of at least one predictor
    quality: QualityAxis  # what the quality is
    caption: str  # the environment of the measurement
    title: str  # of the study
    mark: str | None = None  # a warning, such as "SIMULATED RATINGS", in the title and across every figure
    units: str = "units"  # what the means are over, in the plural

    def write(self, folder: Path) -> None:
        """Write packet_rate, quality and quality_over_rate and curves.csv, into an existing folder."""
        for name in ("packet_rate", "quality", "quality_over_rate"):
            save(self.figure(name), folder / name)
        marked = self.curves if self.mark is None else self.curves.assign(mark=self.mark)
        marked.to_csv(folder / "curves.csv", index=False)

    def figure(self, name: str) -> Figure:
        """Packet rate (Fig. 7) or quality (Fig. 8) over the Weber factor, or quality over the packet rate (Fig. 9)."""
        count, webers = int(self.curves.units.max()), sorted(100.0 * self.curves.weber.unique())
        remark = f"One of {self.units}: no confidence interval."
        if count > 1:
            remark = (
                f"Mean over {count} {self.units} and its {100 * CONFIDENCE:g} % confidence interval: "
                f"percentiles of {RESAMPLES:,} bootstrap resamples."
            )
        if name == "quality_over_rate":
            remark += f" A curve runs from k = {webers[0]:g} % (most packets) to {webers[-1]:g} %."
        title = {"packet_rate": "Packet rate", "quality": "Quality", "quality_over_rate": "Quality over packet rate"}
        figure = sheet(BODY_CM, f"{title[name]}, {self.title}", f"{remark}\n{self.caption}", self.mark)
        axes = figure.add_subplot()
        watermark(axes, self.mark)
        legend(axes, handles(self.curves))
        if name == "quality_over_rate":
            draw_over_rate(axes, self.curves, self.quality)
        else:
            draw_over_weber(axes, self.curves, RATE if name == "packet_rate" else self.quality)
        return figure


def handles(curves: "DataFrame") -> list[Line2D]:
    """Entries of the legend."""
    found = styles(curves.predictor.unique())
    return [Line2D([], [], label=name, linewidth=1.5, **_line(style)) for name, style in found.items()]


def draw_over_weber(axes: Any, curves: "DataFrame", what: str | QualityAxis) -> None:
    """Draw the packet rate (`RATE`) or the quality over the Weber factor, with bands."""
    column = what.column if isinstance(what, QualityAxis) else what
    for predictor, style in styles(curves.predictor.unique()).items():
        mine = curves[curves.predictor == predictor]
        percents = (100.0 * mine.weber).round(9)
        low, high = mine[f"{column}_low"], mine[f"{column}_high"]
        axes.fill_between(percents, low, high, color=style.colour, alpha=0.10, linewidth=0.0, label=f"_{predictor}")
        for end in (low, high):
            axes.plot(percents, end, color=style.colour, linestyle=style.line, linewidth=0.6, alpha=0.6)
        axes.plot(percents, mine[f"{column}_mean"], label=predictor, linewidth=1.5, **_line(style))
    axes.grid(alpha=0.3, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_xlabel("Weber factor k [%]")
    axes.set_xticks(_weber_ticks(curves))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    if isinstance(what, QualityAxis):
        _quality(axes, curves, what)
    else:
        axes.set_ylabel(RATE_LABEL)
        _rate_scale(axes, curves, "y")


def draw_over_rate(axes: Any, curves: "DataFrame", quality: QualityAxis) -> None:
    """Draw the quality over packets per second, one point for each Weber factor, with error bars both ways."""
    for predictor, style in styles(curves.predictor.unique()).items():
        mine = curves[curves.predictor == predictor]
        (x, *across), (y, *up) = (
            (
                mine[f"{name}_mean"],
                mine[f"{name}_mean"] - mine[f"{name}_low"],
                mine[f"{name}_high"] - mine[f"{name}_mean"],
            )
            for name in (RATE, quality.column)
        )
        axes.errorbar(
            x, y, xerr=across, yerr=up, fmt="none", ecolor=style.colour,
            elinewidth=0.7, capsize=1.8, capthick=0.7, alpha=0.75, label=f"_{predictor}",
        )  # fmt: skip
        axes.plot(x, y, label=predictor, linewidth=1.5, **_line(style))
    axes.grid(alpha=0.3, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_xlabel(RATE_LABEL)
    _rate_scale(axes, curves, "x")
    _quality(axes, curves, quality)


def _line(style: PlotStyle) -> dict[str, Any]:
    return {"color": style.colour, "linestyle": style.line, "marker": style.marker, "markersize": style.size}


def _rate_scale(axes: Any, curves: "DataFrame", which: Literal["x", "y"]) -> None:
    """Logarithmic, because rates fall as 1/k; linear if a rate is 0."""
    if (curves[f"{RATE}_low"] <= 0.0).any():
        axes.set(**{f"{which}lim": (0.0, None)})
        return
    axes.set(**{f"{which}scale": "log"})
    axis = axes.xaxis if which == "x" else axes.yaxis
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high > 10.0 * low else (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_locator(NullLocator())


def _quality(axes: Any, curves: "DataFrame", quality: QualityAxis) -> None:
    is_higher = quality.better == "higher"
    axes.set_ylabel(f"{quality.label}  (up is better{'' if is_higher else ': axis reversed'})")
    if quality.limits is not None:
        low, high = quality.limits
        room = 0.02 * (high - low)  # a marker on the limit stays visible
        axes.set_ylim(low - room, high + room)
    elif not is_higher and (curves[f"{quality.column}_low"] >= 0.0).all():
        axes.set_ylim(bottom=0.0)
    if quality.words is not None:
        levels = sorted(quality.words)
        axes.set_yticks(levels, [f"{fill(quality.words[level], 14)}  {level}" for level in levels], fontsize=8)
    if not is_higher:
        axes.invert_yaxis()


def _weber_ticks(curves: "DataFrame") -> list[float]:
    """The Weber factors of the curves [%], without those whose labels would overlap."""
    percents = sorted((100.0 * curves.weber).round(9).unique())
    ticks = percents[:1]
    for percent in percents[1:]:
        if percent - ticks[-1] > 0.05 * (percents[-1] - percents[0]):
            ticks.append(percent)
    return ticks
