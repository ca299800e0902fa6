"""Figures beside the page. Needs matplotlib (extra: plots)."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter

from weberlink.codec.predictors import ADAPTIVE, HYBRID
from weberlink.studies.adaptive.comparison import AdaptiveResults, MatchRow, felt_ratios, geometric_mean, ratios
from weberlink.studies.adaptive.document import FIGURES
from weberlink.studies.adaptive.signals import AdaptiveScope
from weberlink.studies.adaptive.tables import ablations
from weberlink.studies.adaptive.targets import MOST
from weberlink.studies.adaptive.variants import FLOOR_N
from weberlink.studies.adaptive.work import RATES, smoothed_name
from weberlink.studies.curves import Band
from weberlink.studies.sheet import dot, legend, save, sheet

OURS, OTHER, FAINT = "#0072B2", "#D55E00", "0.6"
ROW_CM = 0.48


def draw(results: AdaptiveResults, scope: AdaptiveScope, folder: Path, caption: str) -> None:
    """Write all of `FIGURES`.

    Raises:
        OSError: if a file cannot be written.
    """
    drawn = {
        "packets": packets(results, caption),
        "ablation": ablation(results, caption),
        "felt": felt(results.matches, scope, caption),
    }
    for name, figure in drawn.items():
        save(figure, folder / name)


def packets(results: AdaptiveResults, caption: str) -> Figure:
    """A row for each recording and scene, a dot for each seed."""
    halves = {
        half: ratios(results.of(RATES, half=half, floor_n=FLOOR_N), ADAPTIVE, HYBRID) for half in ("reported", "chosen")
    }
    there = {one.group for found in halves.values() for one in found}
    groups = [group for group in dict.fromkeys(row.group for row in results.of(RATES)) if group in there]
    figure, axes = _rows(FIGURES["packets"], groups, caption)
    place = {group: row for row, group in enumerate(groups)}
    for half, face in (("chosen", "none"), ("reported", OURS)):
        found = halves[half]
        axes.plot(
            [one.value for one in found], [place[one.group] for one in found], "o", color=OURS, markersize=5,
            markerfacecolor=face, linestyle="",
        )  # fmt: skip
    _band(axes, geometric_mean(halves["reported"]))
    axes.axvline(MOST, color=OTHER, linewidth=1.0, linestyle="--")
    handles = [dot("held-out half", "o", OURS), dot("tuning half", "o", OURS)]
    handles[1].set_markerfacecolor("none")
    legend(axes, handles)
    axes.set_xlabel(
        fontsize=9, xlabel="a dot for each signal; line and band: mean and 95 % of the filled; dashed: target"
    )
    return figure


def ablation(results: AdaptiveResults, caption: str) -> Figure:
    """A row for each part that is off."""
    found = [(name, geometric_mean(each)) for name, each in ablations(results) if each]
    figure, axes = _rows(FIGURES["ablation"], [name for name, _ in found], caption)
    for row, (_, mean) in enumerate(found):
        _mean(axes, mean, row, OURS, "o")
    axes.set_xlabel(fontsize=9, xlabel="packets / those of adaptive; geometric mean and 95 %")
    return figure


def felt(matches: Sequence[MatchRow], scope: AdaptiveScope, caption: str) -> Figure:
    """Error and steps over those of the hybrid, without and with ramps, for the signals that have all."""
    variants = [ADAPTIVE, *(smoothed_name(ticks, share) for ticks, share in scope.smoothings)]
    names = ["adaptive", *(f"ramp {ticks} ticks, {share:g}" for ticks, share in scope.smoothings)]
    smoothed = {row.signal for row in matches if row.variant == variants[-1]}
    figure, axes = _rows(FIGURES["felt"], names, caption, 3.0 * ROW_CM)
    shown = (
        ("error_rms_n", "RMS error", OURS, "o", -0.2),
        ("largest_step_n", "largest step", OTHER, "s", 0.0),
        ("step_jnd", "99.9th percentile of steps", "#009E73", "D", 0.2),
    )
    for figure_of, _, colour, marker, offset in shown:
        for row, variant in enumerate(variants):
            found = felt_ratios(matches, variant, figure_of, signals=smoothed)
            values = [one.value for one in found]
            axes.plot(values, [row + offset] * len(found), marker, color=FAINT, markersize=2.5, alpha=0.7)
            _mean(axes, geometric_mean(found), row + offset, colour, marker)
    legend(axes, [dot(label, marker, colour) for _, label, colour, marker, _ in shown])
    axes.set_xlabel(fontsize=9, xlabel="over that of the hybrid at the same packets; grey: single signals")
    return figure


def _rows(title: str, names: Sequence[str], caption: str, row_cm: float = ROW_CM) -> tuple[Figure, Any]:
    """A page with a row for each name, and a logarithmic axis of ratios."""
    figure = sheet(2.8 + max(row_cm * len(names), 3.0), title, caption)
    axes = figure.add_subplot()
    axes.set_xscale("log")
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.grid(axis="both", alpha=0.3, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.axvline(1.0, color="black", linewidth=0.8)
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xticks([0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0])
    axes.tick_params(axis="x", labelsize=8)
    return figure, axes


def _band(axes: Any, mean: Band | None) -> None:
    if mean is not None:
        axes.axvspan(mean.low, mean.high, color=OURS, alpha=0.15, linewidth=0.0)
        axes.axvline(mean.mean, color=OURS, linewidth=1.0)


def _mean(axes: Any, mean: Band | None, place: float, colour: str, marker: str) -> None:
    if mean is not None:
        axes.plot([mean.low, mean.high], [place] * 2, color=colour, linewidth=1.6)
        axes.plot(mean.mean, place, marker, color=colour, markersize=5)
