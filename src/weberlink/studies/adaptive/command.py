"""The `adaptive` command: what choosing by record and estimating from all samples is worth, on recordings and scenes.

Owns how the work is spread and the files that come out. What is done with a signal, and how it is judged, is in
`weberlink.studies.adaptive`.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from time import perf_counter
from typing import Any

from rich.table import Table

from weberlink.codec.predictors import ADAPTIVE, HYBRID
from weberlink.studies.adaptive.cost import cost
from weberlink.studies.adaptive.document import document
from weberlink.studies.adaptive.rows import Cost, Match, Rate, Results
from weberlink.studies.adaptive.signals import FULL, NOISE_N, QUICK, Scope, recordings, scenes
from weberlink.studies.adaptive.tables import MET
from weberlink.studies.adaptive.verdict import targets
from weberlink.studies.adaptive.work import Task, done, length, tasks
from weberlink.studies.evaluate.command import read_traces
from weberlink.studies.evaluate.study import NamedTrace
from weberlink.studies.parallel import parallel_map
from weberlink.system.environment import environment, footer
from weberlink.system.extras import need

PAGE = "README.md"
NUMBERS = "adaptive.json"
SHIPPED = "traces/operator.csv"
"""What is coded beside the scenes where no recording is given."""


@dataclass(frozen=True)
class AdaptiveStudy:
    """All rows, and how they are shown."""

    results: Results
    scope: Scope
    document: dict[str, Any]
    table: Table
    caption: str

    def draw(self, folder: Path) -> None:
        """Write the page, and beside it the figures and all rows.

        Raises:
            OSError: if the folder or a file in it cannot be made.
        """
        from weberlink.studies.adaptive.figures import draw  # noqa: PLC0415 - heavy, only wanted here

        folder.mkdir(parents=True, exist_ok=True)
        (folder / NUMBERS).write_text(json.dumps(self.document, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        draw(self.results, self.scope, folder, self.caption)
        page = document(self.results, self.scope, self.caption, drawn=True)
        (folder / PAGE).write_text(page, encoding="utf-8")


def run(
    traces: Sequence[Path],
    *,
    quick: bool,
    docs: bool,
    workers: int | None,
    progress: Callable[[int, int, str], None],
) -> AdaptiveStudy:
    """Measure everything; the numbers do not depend on the number of workers, but for the run times.

    Args:
        traces: recordings of people; without, the one that is shipped.
        quick: a glance at a part of it.
        docs: whether page and figures will be wanted.
        workers: processes; None for as many as there are processors.
        progress: told how many of how many pieces are done, and what they are.

    Raises:
        ConfigurationError: for a trace that cannot be used, or a missing extra; nothing was computed then.
    """
    if docs:
        need("matplotlib", "plots", "--docs")
    given = read_traces(traces or [Path(str(files("weberlink.configs") / SHIPPED))])
    scope = QUICK if quick else FULL
    began = perf_counter()
    results = _measured(tasks(given, scope), workers, progress)
    progress(0, 1, "run time of a tick")
    results.costs.extend(_costs(given, scope))
    facts = environment()
    caption = footer(facts)
    content = {
        "quick": quick,
        "scope": scope._asdict(),
        "recordings": [recording.name for recording in given],
        "targets": [vars(target) for target in targets(results)],
        **results.as_json(),
        "run_time_s": perf_counter() - began,
        "environment": facts,
    }
    return AdaptiveStudy(results, scope, content, _table(results, caption), caption)


def _measured(work: Sequence[Task], workers: int | None, progress: Callable[[int, int, str], None]) -> Results:
    """Rows in the order of the work."""
    found = parallel_map(done, work, workers, length, lambda count, total: progress(count, total, "signals"))
    rows = [row for part in found for row in part]
    rates = [row for row in rows if isinstance(row, Rate)]
    return Results(rates, [row for row in rows if isinstance(row, Match)])


def _costs(given: Sequence[NamedTrace], scope: Scope) -> list[Cost]:
    """Alone, now that all else is done."""
    judged = [
        source
        for source in recordings(given, scope) + scenes(scope, NOISE_N, [seed for seed in scope.seeds if seed == 2])
        if source.key.half == "reported"
    ]
    signals = [source.signal().middle(scope.cost_ticks) for source in judged]
    return [cost(variant, signals) for variant in (HYBRID, ADAPTIVE)]


def _table(results: Results, caption: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), caption=caption, caption_justify="left")
    for name in ("asked for", "limit", "found", ""):
        table.add_column(name)
    for one in targets(results):
        table.add_row(one.what, one.asked, one.found, MET[one.met].strip("*"))
    return table
