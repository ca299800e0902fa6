"""The result of a study, and the plain tables in which studies are printed."""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from rich.console import RenderableType
from rich.table import Table

if TYPE_CHECKING:
    from pandas import DataFrame, Series


@dataclass(frozen=True)
class StudyResult:
    """A study, complete or as far as it went until Ctrl-C."""

    document: dict[str, Any]  # for JSON
    table: RenderableType  # one or more tables for the terminal
    # draws the figures into an existing folder; it imports matplotlib. None for nothing to draw.
    figures: Callable[[Path], None] | None
    # how much is done where Ctrl-C ended the study, as "12 of 80 tasks"; empty if all is
    interrupted: str = field(default="", kw_only=True)

    def draw(self, folder: Path) -> None:
        """Make the folder and draw the figures."""
        if self.figures is not None:
            folder.mkdir(parents=True, exist_ok=True)
            self.figures(folder)


def how_much(done: int, total: int, what: str) -> str:
    """What `StudyResult.interrupted` says; empty if all is done."""
    return "" if done == total else f"{done} of {total} {what}"


def plain_table(first: str, *others: str, left: Collection[str] = (), wrap: bool = False, **options: Any) -> Table:
    """A table without lines.

    Args:
        first: name of the first column, which is left-justified.
        others: names of the other columns, which are right-justified.
        left: those of them that are left-justified.
        wrap: whether long cells of the other columns are wrapped.
        options: of `rich.table.Table`.
    """
    justified = {"title_justify": "left", "caption_justify": "left"}
    table = Table(box=None, pad_edge=False, **({"padding": (0, 2, 0, 0)} | justified | options))
    table.add_column(first, no_wrap=True)
    for name in others:
        table.add_column(name, justify="left" if name in left else "right", no_wrap=not wrap)
    return table


class Column(NamedTuple):
    """How a column of a data frame is printed."""

    head: str  # its name in the table
    form: str | Callable[[Any], str] = "{}"  # a format string for a value, or a function that returns the text
    left: bool = False  # whether it is left-justified; the first column always is


def frame_table(
    frame: "DataFrame",
    columns: Mapping[str, Column],
    *,
    notes: Iterable[str] = (),
    style: Callable[[Any], str | None] = lambda _: None,
    **options: Any,
) -> Table:
    """Some columns of a data frame as a table without lines; "-" stands for a missing value.

    Args:
        frame: one row for each row of the table.
        columns: by the name of the column in the frame; at least one.
        notes: lines of the caption.
        style: of a row of the frame, such as "bold"; None for the usual one.
        options: of `plain_table`.
    """
    left = [column.head for column in columns.values() if column.left]
    heads = (column.head for column in columns.values())
    table = plain_table(*heads, left=left, caption="\n".join(notes), **({"padding": (0, 1, 0, 0)} | options))
    shown = frame[list(columns)]
    for (_, row), values, missing in zip(
        frame.iterrows(), shown.itertuples(index=False), shown.isna().to_numpy(), strict=True
    ):
        forms = (column.form if callable(column.form) else column.form.format for column in columns.values())
        cells = ("-" if absent else form(value) for form, value, absent in zip(forms, values, missing, strict=True))
        table.add_row(*cells, style=style(row))
    return table


def pareto(costs: "Series[float]", errors: "Series[float]") -> "Series[bool]":
    """Whether each point is on the Pareto front: finite, and no other is as small in both figures."""
    import pandas as pd  # noqa: PLC0415 - heavy, an extra

    ordered = pd.DataFrame({"cost": costs, "error": errors}).sort_values(["cost", "error"])
    best_before = ordered.error.cummin().shift(fill_value=inf)
    return (ordered.error < best_before).reindex(costs.index)
