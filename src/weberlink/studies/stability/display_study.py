"""What is felt of a scene, as a study: all cells with some schemes, beside the schemes that were here before.

Those are `none`, `tdpa`, `mmt` and `auto`; their figures are data, with their origin.
"""

import json
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from statistics import fmean
from time import perf_counter
from typing import Any

from rich.table import Table

from weberlink.control.table import SCHEMES
from weberlink.studies.baselines import BASELINES
from weberlink.studies.parallel import Progress, parallel_map
from weberlink.studies.result import StudyResult, how_much, plain_table
from weberlink.studies.stability.display import Display, DisplayCell, cells, measured
from weberlink.system.configuration import ConfigurationError
from weberlink.system.configuration.extras import need
from weberlink.system.environment import environment, footer

GHOST_S = 0.06
"""A force that lasts without a contact for this much longer than the round trip is a ghost [s]."""
MOST_CONTACTS = 24
"""The scripts make no more begins and ends of contacts than this; more is chatter."""
WORSE, WORSE_N = 1.1, 0.05
"""A cell is worse if its error is above that of the best scheme before by this ratio and by this force [N] too."""


Figures = dict[DisplayCell, dict[str, Display]]
"""By cell and scheme."""


def former() -> tuple[Figures, dict[str, str]]:
    """The figures of the four schemes before, and where they come from."""
    stored = json.loads((files(__package__) / "former.json").read_text(encoding="utf-8"))
    schemes = stored["schemes"]
    figures = {
        DisplayCell(*row[:4]): {name: Display(*each) for name, each in zip(schemes, row[4:], strict=True)}
        for row in stored["cells"]
    }
    return figures, stored["origin"]


def run(schemes: Sequence[str], *, plots: bool, workers: int | None, progress: Progress) -> StudyResult:
    """Run all cells, or as many as are done when Ctrl-C stops them, with each scheme.

    Args:
        schemes: by name; those of `weberlink.studies.baselines` too.
        plots: whether figures will be drawn.
        workers: processes; None for one per processor, 1 for this process alone.
        progress: receives the number of finished runs and of all.

    Raises:
        ConfigurationError: matplotlib is missing, or no scheme has that name.
    """
    if plots:
        need("matplotlib", "studies", "--plots")
    for name in schemes:
        if name not in BASELINES and name not in SCHEMES:
            raise ConfigurationError(f"--scheme: {name!r} is none of {', '.join((*SCHEMES, *BASELINES))}")
    began = perf_counter()
    tasks = [(cell, scheme) for scheme in dict.fromkeys(schemes) for cell in cells()]
    found = parallel_map(measured, tasks, workers, lambda task: 1.0 + 1e-3 * task[0].delay_ms, progress)
    figures: Figures = {}
    for index, display in found.items():
        cell, scheme = tasks[index]
        figures.setdefault(cell, {})[scheme] = display
    return assemble(figures, of=len(tasks), run_time=perf_counter() - began)


def assemble(figures: Figures, *, of: int, run_time: float) -> StudyResult:
    """The study of what was computed, of so many runs in all, in a run time [s]."""
    facts, (before, origin) = environment(), former()
    done = sum(map(len, figures.values()))
    interrupted = how_much(done, of, "runs")
    caption = "\n".join(filter(None, (interrupted and f"partial: {interrupted}", footer(facts, 0))))
    document = {
        "cells": [
            cell._asdict()
            | {
                "schemes": {name: each._asdict() for name, each in displays.items()},
                "former_error_n": best(before, cell),
            }
            for cell, displays in figures.items()
        ],
        "summary": {name: summary(figures, before, name) for name in _schemes(figures)},
        "former_origin": origin,
        "run_time_s": run_time,
        "environment": facts,
    }

    def draw(folder: Path) -> None:
        from weberlink.studies.stability.display_figure import display_map  # noqa: PLC0415 - slow import

        if figures:
            display_map(figures, before, folder / "stability_display.png", caption)

    return StudyResult(document, _table(figures, before, caption), draw, interrupted=interrupted)


def best(figures: Figures, cell: DisplayCell) -> float | None:
    """The least felt error [N] of the schemes of a cell; None if it has none."""
    return min((each.error_n for each in figures.get(cell, {}).values()), default=None)


def summary(figures: Figures, before: Figures, scheme: str) -> dict[str, Any]:
    """What is judged of a scheme over all of its cells."""
    mine = {cell: each[scheme] for cell, each in figures.items() if scheme in each and not each[scheme].failure}
    tracking = [each.tracking_m for cell, each in mine.items() if cell.delay_ms <= 100 and each.tracking_m is not None]

    def is_worse(cell: DisplayCell) -> bool:
        least = best(before, cell)
        error = mine[cell].error_n
        return least is not None and error > WORSE * least and error > least + WORSE_N

    return {
        "cells": len(mine),
        "failed": sum(bool(each[scheme].failure) for each in figures.values() if scheme in each),
        "compared": sum(cell in before for cell in mine),
        "worse": sum(map(is_worse, mine)),
        "ghosts": sum(is_ghost(cell, each) for cell, each in mine.items()),
        "bound_kept": sum(each.bound_share <= 1.0 for each in mine.values()),
        "few_contacts": sum(each.contacts <= MOST_CONTACTS for each in mine.values()),
        "tracking_m": max(tracking, default=None),
    }


def is_ghost(cell: DisplayCell, display: Display) -> bool:
    return _ghost(cell, display) > GHOST_S


def _ghost(cell: DisplayCell, display: Display) -> float:
    """How much longer than the round trip a force without a contact lasts [s]."""
    return max(0.0, display.ghost_s - 2e-3 * cell.delay_ms)


def _schemes(figures: Figures) -> list[str]:
    return list(dict.fromkeys(name for displays in figures.values() for name in displays))


def _table(figures: Figures, before: Figures, caption: str) -> Table:
    lines = [_sentence(name, summary(figures, before, name)) for name in _schemes(figures)]
    text = "\n".join(
        (
            "felt: RMS of felt minus pressed in N, the delay contained, mean over links",
            "  and hands; former: that of the best of none, tdpa, mmt, auto in each cell",
            "the largest of ghost (beyond the round trip, ms), contacts",
            "  (begins and ends), out (mJ), bound (share got out, %), apart (mm)",
            *lines,
            caption,
        )
    )
    names = ("ms", "scene", "scheme", "former", "felt", "ghost", "contacts", "out", "bound", "apart")
    table = plain_table(*names, left=("scene", "scheme"), caption=text, padding=(0, 1, 0, 0))
    groups: dict[tuple[int, str, str], list[tuple[DisplayCell, Display]]] = {}
    for cell, displays in sorted(figures.items(), key=lambda item: item[0].delay_ms):
        for name, display in displays.items():
            groups.setdefault((cell.delay_ms, cell.scene, name), []).append((cell, display))
    for (delay, scene, name), group in groups.items():
        least = [error for cell, _ in group if (error := best(before, cell)) is not None]
        each = [display for _, display in group]
        table.add_row(
            str(delay),
            scene,
            name,
            f"{fmean(least):.2f}" if least else "-",
            "failed" if any(one.failure for one in each) else f"{fmean(one.error_n for one in each):.2f}",
            f"{1e3 * max(_ghost(cell, display) for cell, display in group):.0f}",
            str(max(one.contacts for one in each)),
            f"{1e3 * max(one.energy_out_j for one in each):.1f}",
            f"{100.0 * max(one.bound_share for one in each):.0f}",
            f"{1e3 * max(one.tracking_m or 0.0 for one in each):.1f}",
        )
    return table


def _sentence(name: str, judged: dict[str, Any]) -> str:
    kept, apart = f"bound kept in {judged['bound_kept']} of {judged['cells']}", 1e3 * (judged["tracking_m"] or 0.0)
    return (
        f"{name}: {judged['worse']} of {judged['compared']} worse than the best before by 10 % and {WORSE_N:g} N\n"
        f"  {judged['ghosts']} ghosts; {kept}; {judged['failed']} failed\n"
        f"  at most {MOST_CONTACTS} contacts in {judged['few_contacts']}; up to 100 ms at most {apart:.1f} mm apart"
    )
