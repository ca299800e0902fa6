"""Figures over Weber factors: packet rate, quality, and quality over packet rate, with confidence intervals.

As Figs. 7 to 9 of Xu, Kammerl, Chaudhari and Steinbach, "Hybrid signal-based and geometry-based prediction for haptic
data reduction", HAVE 2011.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import Any, Literal

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

from weberlink.studies.curves import CONFIDENCE, RESAMPLES, Band, CurvePoint, Curves, write_csv
from weberlink.studies.sheet import PlotStyle, legend, save, sheet, styles, watermark

BODY_CM = 10.2
WEBER_LABEL = "Weber factor k [%]"
RATE_LABEL = "packets per second"


@dataclass(frozen=True)
class QualityAxis:
    """How the quality of the observations is drawn.

    Args:
        label: with the unit, such as "rating" or "error, RMS [JND]".
        better: which end is good; that end is drawn up.
        limits: least and largest possible value, such as 0 and 5; None for those of the data.
        column: prefix of its columns in the CSV file.
        words: of single values, written beside these on the axis; None for numbers alone.
    """

    label: str
    better: Literal["higher", "lower"]
    limits: tuple[float, float] | None = None
    column: str = "quality"
    words: Mapping[int, str] | None = None

    @property
    def full_label(self) -> str:
        return f"{self.label}  (up is better{'' if self.better == 'higher' else ': axis reversed'})"


@dataclass(frozen=True)
class CurveFigures:
    """The three figures of one set of curves.

    Args:
        curves: at least one predictor.
        quality: what the quality is.
        caption: the environment of the measurement.
        title: of the study.
        mark: a warning, such as "SIMULATED RATINGS", in the title and across every figure.
        units: what the means are over, in the plural.
    """

    curves: Curves
    quality: QualityAxis
    caption: str
    title: str
    mark: str | None = None
    units: str = "units"

    def write(self, folder: Path) -> None:
        """Write packet_rate, quality and quality_over_rate and curves.csv, into an existing folder."""
        save(self.packet_rate(), folder / "packet_rate")
        save(self.quality_over_weber(), folder / "quality")
        save(self.quality_over_rate(), folder / "quality_over_rate")
        write_csv(self.curves, folder / "curves.csv", self.quality.column, self.mark)

    def packet_rate(self) -> Figure:
        """Packets per second over the Weber factor (Fig. 7)."""
        figure, axes = self._sheet("Packet rate")
        self._over_weber(axes, lambda point: point.packets_per_s)
        axes.set_ylabel(RATE_LABEL)
        self._rate_scale(axes, "y")
        return figure

    def quality_over_weber(self) -> Figure:
        """Quality over the Weber factor (Fig. 8)."""
        figure, axes = self._sheet("Quality")
        self._over_weber(axes, lambda point: point.quality)
        self._quality(axes)
        return figure

    def quality_over_rate(self) -> Figure:
        """Quality over packets per second, one point for each Weber factor (Fig. 9)."""
        figure, axes = self._sheet("Quality over packet rate", _run_of_webers(self.curves))
        for predictor, style in styles(self.curves).items():
            points = self.curves[predictor]
            rates, qualities = [point.packets_per_s for point in points], [point.quality for point in points]
            axes.errorbar(
                [band.mean for band in rates], [band.mean for band in qualities],
                xerr=_reach(rates), yerr=_reach(qualities), fmt="none", ecolor=style.colour,
                elinewidth=0.7, capsize=1.8, capthick=0.7, alpha=0.75, label=f"_{predictor}",
            )  # fmt: skip
            _curve(axes, predictor, style, rates, qualities)
        axes.set_xlabel(RATE_LABEL)
        self._rate_scale(axes, "x")
        self._quality(axes)
        return figure

    def _sheet(self, title: str, remark: str = "") -> tuple[Figure, Any]:
        caption = "\n".join(filter(None, (self._confidence() + remark, self.caption)))
        figure = sheet(BODY_CM, f"{title}, {self.title}", caption, self.mark)
        axes = figure.add_subplot()
        axes.grid(alpha=0.3, linewidth=0.6)
        axes.set_axisbelow(True)
        watermark(axes, self.mark)
        legend(axes, [_handle(predictor, style) for predictor, style in styles(self.curves).items()])
        return figure, axes

    def _confidence(self) -> str:
        count = max((point.units for point in _points(self.curves)), default=0)
        if count < 2:
            return f"One of {self.units}: no confidence interval. "
        return (
            f"Mean over {count} {self.units} and its {100 * CONFIDENCE:g} % confidence interval: "
            f"percentiles of {RESAMPLES:,} bootstrap resamples. "
        )

    def _over_weber(self, axes: Any, band_of: Callable[[CurvePoint], Band]) -> None:
        for predictor, style in styles(self.curves).items():
            percents = [_percent(point) for point in self.curves[predictor]]
            bands = [band_of(point) for point in self.curves[predictor]]
            low, high = [band.low for band in bands], [band.high for band in bands]
            axes.fill_between(percents, low, high, color=style.colour, alpha=0.10, linewidth=0.0, label=f"_{predictor}")
            for end in (low, high):
                axes.plot(percents, end, color=style.colour, linestyle=style.line, linewidth=0.6, alpha=0.6)
            _curve(axes, predictor, style, [Band(percent, percent, percent) for percent in percents], bands)
        axes.set_xlabel(WEBER_LABEL)
        axes.set_xticks(_weber_ticks(self.curves))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))

    def _rate_scale(self, axes: Any, which: Literal["x", "y"]) -> None:
        """Logarithmic, because rates fall as 1/k; linear if a rate is 0."""
        if any(point.packets_per_s.low <= 0.0 for point in _points(self.curves)):
            axes.set(**{f"{which}lim": (0.0, None)})
            return
        axes.set(**{f"{which}scale": "log"})
        axis = axes.xaxis if which == "x" else axes.yaxis
        low, high = axis.get_view_interval()
        axis.set_major_locator(
            LogLocator(subs=(1.0, 2.0, 5.0) if high > 10.0 * low else (1.0, 1.5, 2.0, 3.0, 5.0, 7.0))
        )
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_locator(NullLocator())

    def _quality(self, axes: Any) -> None:
        axes.set_ylabel(self.quality.full_label)
        if self.quality.limits is not None:
            low, high = self.quality.limits
            room = 0.02 * (high - low)  # a marker on the limit stays visible
            axes.set_ylim(low - room, high + room)
        elif self.quality.better == "lower" and all(point.quality.low >= 0.0 for point in _points(self.curves)):
            axes.set_ylim(bottom=0.0)
        if self.quality.words is not None:
            levels = sorted(self.quality.words)
            axes.set_yticks(levels, [f"{fill(self.quality.words[level], 14)}  {level}" for level in levels], fontsize=8)
        if self.quality.better == "lower":
            axes.invert_yaxis()


def _points(curves: Curves) -> Iterable[CurvePoint]:
    return (point for points in curves.values() for point in points)


def _percent(point: CurvePoint) -> float:
    """The Weber factor [%], without rounding errors of the multiplication."""
    return round(100.0 * point.weber, 9)


def _curve(axes: Any, predictor: str, style: PlotStyle, across: Sequence[Band], up: Sequence[Band]) -> None:
    x, y = [band.mean for band in across], [band.mean for band in up]
    axes.plot(x, y, label=predictor, linewidth=1.5, **_line(style))


def _handle(predictor: str, style: PlotStyle) -> Line2D:
    return Line2D([], [], label=predictor, linewidth=1.5, **_line(style))


def _line(style: PlotStyle) -> dict[str, Any]:
    return {"color": style.colour, "linestyle": style.line, "marker": style.marker, "markersize": style.size}


def _reach(bands: Sequence[Band]) -> list[list[float]]:
    """Lengths of error bars: below, above."""
    return [[band.mean - band.low for band in bands], [band.high - band.mean for band in bands]]


def _run_of_webers(curves: Curves) -> str:
    webers = sorted({_percent(point) for point in _points(curves)})
    return f"A curve runs from k = {webers[0]:g} % (most packets) to {webers[-1]:g} %." if len(webers) > 1 else ""


def _weber_ticks(curves: Curves) -> list[float]:
    """The Weber factors of the curves [%], without those whose labels would overlap."""
    percents = sorted({_percent(point) for point in _points(curves)})
    span = percents[-1] - percents[0]
    ticks = percents[:1]
    for percent in percents[1:]:
        if percent - ticks[-1] > 0.05 * span:
            ticks.append(percent)
    return ticks
