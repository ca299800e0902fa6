"""The result of a study, and the plain tables in which studies are printed."""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import RenderableType
from rich.table import Table


@dataclass(frozen=True)
class StudyResult:
    """A finished study.

    Args:
        document: for JSON.
        table: one or more tables for the terminal.
        figures: draws the figures into an existing folder; it imports matplotlib.
    """

    document: dict[str, Any]
    table: RenderableType
    figures: Callable[[Path], None]

    def draw(self, folder: Path) -> None:
        """Make the folder and draw the figures.

        Raises:
            OSError: if the folder or a file in it cannot be made.
        """
        folder.mkdir(parents=True, exist_ok=True)
        self.figures(folder)


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
