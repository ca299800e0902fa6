"""Figures for print: page, style of each predictor, mark, caption and files. Needs matplotlib (extra: studies)."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import cycle
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple

from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image  # comes with matplotlib
from PIL.PngImagePlugin import PngInfo

from weberlink_studies.drawing import current

WIDTH_IN = 16.0 / 2.54  # figures are printed at this width, so font sizes are those on the page
SMALLEST_PT = 8.0
LINE = 104  # characters of the smallest font across the page
SENT = "#0072B2"
"""Colour of transmitted samples."""
MARK_COLOUR = "#B00020"


class PlotStyle(NamedTuple):
    """How a predictor is drawn; colours suit the colour-blind, and line and marker differ in grey."""

    colour: str
    line: Any
    marker: str
    size: float  # of the marker [pt]; it shrinks in the order of drawing, so that coincident curves stay visible


STYLES = {
    "zoh": PlotStyle("#0072B2", "--", "s", 7.5),
    "linear": PlotStyle("#D55E00", "-.", "^", 6.5),
    "plane": PlotStyle("#009E73", ":", "D", 5.5),
    "sphere": PlotStyle("#CC79A7", (0, (5, 1.2, 1, 1.2, 1, 1.2)), "v", 5.0),
    "affine": PlotStyle("#E69F00", (0, (1, 2)), "X", 4.6),
    "surface": PlotStyle("#7F7F7F", (0, (4, 1)), "*", 4.4),
    "path": PlotStyle("#56B4E9", (0, (7, 2)), "P", 4.2),
    "elastic": PlotStyle("#8C6D31", (0, (6, 1, 2, 1)), "d", 4.1),
    "hybrid": PlotStyle("#000000", "-", "o", 4.0),
    "adaptive": PlotStyle("#8B0000", (0, (9, 1)), "h", 3.8),
}
"""Colours of Okabe and Ito, and some more."""
MORE_STYLES = (
    PlotStyle("#4B0082", (0, (8, 3)), "p", 6.0),
    PlotStyle("#808000", (0, (2, 3)), "<", 5.0),
    PlotStyle("#404040", (0, (3, 3)), ">", 5.0),
)


def styles(predictors: Iterable[str]) -> dict[str, PlotStyle]:
    """A style for each predictor; known predictors have the same in every figure."""
    more = cycle(MORE_STYLES)
    return {name: STYLES[name] if name in STYLES else next(more) for name in predictors}


def dot(label: str, marker: str, colour: str, size: float = 4.5) -> Line2D:
    """A legend entry: a marker without a line."""
    return Line2D([], [], label=label, marker=marker, color=colour, linestyle="", markersize=size)


def legend(axes: Any, handles: Sequence[Any], columns: int = 5, above: float = 1.0) -> None:
    """Draw the legend between the title and `axes`, at `above` of their height."""
    axes.legend(
        handles=handles, loc="lower center", bbox_to_anchor=(0.5, above), ncols=columns, fontsize=9,
        handlelength=3.2, columnspacing=1.6, frameon=False,
    )  # fmt: skip


def sheet(body_cm: float, title: str, caption: str, mark: str | None = None) -> Figure:
    """An empty figure with title and footer."""
    footer_cm = 0.35 * (2 + footer(caption).count("\n")) if current().footer else 0.0
    figure = Figure(figsize=(WIDTH_IN, (body_cm + footer_cm) / 2.54), layout="constrained")
    heading = fill(title if mark is None else f"{mark}: {title}", 78)
    colour = "black" if mark is None else MARK_COLOUR
    figure.suptitle(heading, fontsize=10.5, color=colour, parse_math=False)
    caption_below(figure, caption, footer(caption), x=0.015, ha="left", fontsize=SMALLEST_PT, color="0.3")
    return figure


def caption_below(figure: Figure, caption: str, text: str | None = None, **options: Any) -> None:
    """Give a figure its caption: printed below where a footer is asked for, and in the metadata by `save`."""
    figure.set_label(caption)
    if current().footer:
        figure.supxlabel(caption if text is None else text, parse_math=False, **options)


def footer(caption: str) -> str:
    """The caption in lines that fit the page."""
    return "\n".join(fill(line, LINE) for line in caption.splitlines())


def watermark(axes: Any, mark: str | None) -> None:
    """Draw the mark, large and faint, behind the content of `axes`."""
    if mark is None:
        return
    text = axes.text(
        0.5, 0.5, mark, transform=axes.transAxes, fontsize=min(40.0, 640.0 / len(mark)), fontweight="bold",
        color=MARK_COLOUR, alpha=0.20, rotation=24, ha="center", va="center", zorder=0.5, parse_math=False,
    )  # fmt: skip
    text.set_in_layout(False)


PRINTED = ("png", "svg")


def save(figure: Figure, stem: Path, *, dpi: float = 200, usual: Sequence[str] = PRINTED) -> None:
    """Write `stem` in the formats asked for, with the caption in the metadata.

    Text stays text in SVG and PDF, and equal figures give equal files.
    """
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "weberlink", "pdf.fonttype": 42}):
        for name in current().formats or usual:
            path, metadata = beside(stem, f".{name}"), _metadata(name, str(figure.get_label()))
            figure.savefig(path, dpi=dpi, metadata=metadata)
            if name == "png":  # with a palette it is a third as large
                description = PngInfo()
                description.add_text("Description", str(figure.get_label()))
                with Image.open(path) as image:
                    image.convert("RGB").quantize(128, dither=Image.Dither.NONE).save(
                        path, optimize=True, pnginfo=description
                    )


def _metadata(name: str, caption: str) -> Mapping[str, str | None]:
    """The caption where a format has room for it; no date and no version of the program."""
    if name == "pdf":
        return {"Subject": caption, "Creator": None, "Producer": None, "CreationDate": None}
    if name == "svg":
        return {"Description": caption, "Date": None, "Creator": None}
    return {"Description": caption, "Software": None}


def beside(stem: Path, ending: str) -> Path:
    """`stem` with an ending; unlike `with_suffix`, keeps dots in the stem, as in "k=0.10"."""
    return stem.with_name(stem.name + ending)
