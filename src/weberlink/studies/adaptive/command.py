"""The `adaptive` command: runs the study in parallel and writes its page, figures and rows."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter

from weberlink.codec.predictors import ADAPTIVE, HYBRID
from weberlink.studies.adaptive.coding import cost
from weberlink.studies.adaptive.comparison import AdaptiveResults, CostRow, MatchRow, RateRow
from weberlink.studies.adaptive.document import document
from weberlink.studies.adaptive.signals import FULL, NOISE_N, QUICK, AdaptiveScope, recordings, scenes
from weberlink.studies.adaptive.tables import MET
from weberlink.studies.adaptive.targets import targets
from weberlink.studies.adaptive.work import SignalTask, done, length, tasks
from weberlink.studies.evaluate.traces import SHIPPED, NamedTrace, read_traces
from weberlink.studies.parallel import parallel_map
from weberlink.studies.result import StudyResult, plain_table
from weberlink.system.environment import environment, footer
from weberlink.system.extras import need

PAGE = "README.md"
NUMBERS = "adaptive.json"


def run(
    traces: Sequence[Path],
    *,
    quick: bool,
    docs: bool,
    workers: int | None,
    progress: Callable[[int, int, str], None],
) -> StudyResult:
    """Measure everything; only run times depend on the number of workers.

    Args:
        traces: recordings of people; the shipped one if there are none.
        quick: a small part of the study.
        docs: whether page and figures will be drawn.
        workers: processes; None for one per processor.
        progress: receives the number of finished pieces, of all pieces, and their name.

    Raises:
        ConfigurationError: for a trace that cannot be used, or a missing extra; nothing was computed then.
    """
    if docs:
        need("matplotlib", "plots", "--docs")
    given = read_traces(traces or [SHIPPED])
    return study(given, QUICK if quick else FULL, workers, progress)


def study(
    given: Sequence[NamedTrace], scope: AdaptiveScope, workers: int | None, progress: Callable[[int, int, str], None]
) -> StudyResult:
    """Measure recordings and scenes; arguments as of `run`."""
    began = perf_counter()
    results = _measured(tasks(list(given), scope), workers, progress)
    progress(0, 1, "run time of a tick")
    results.costs.extend(_costs(given, scope))
    facts = environment()
    caption = footer(facts)
    content = {
        "quick": scope is QUICK,
        "scope": scope._asdict(),
        "recordings": [recording.name for recording in given],
        "targets": [vars(target) for target in targets(results)],
        **results.as_json(),
        "run_time_s": perf_counter() - began,
        "environment": facts,
    }

    def draw(folder: Path) -> None:
        from weberlink.studies.adaptive.figures import draw as draw_figures  # noqa: PLC0415 - slow import

        (folder / NUMBERS).write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        draw_figures(results, scope, folder, caption)
        (folder / PAGE).write_text(document(results, scope, caption, drawn=True), encoding="utf-8")

    others = ("limit", "measured", "")
    table = plain_table("target", *others, left=others, wrap=True, caption=caption)
    for one in targets(results):
        table.add_row(one.what, one.asked, one.found, MET[one.met].strip("*"))
    return StudyResult(content, table, draw)


def _measured(
    work: Sequence[SignalTask], workers: int | None, progress: Callable[[int, int, str], None]
) -> AdaptiveResults:
    """Rows in the order of the tasks."""
    found = parallel_map(done, work, workers, length, lambda count, total: progress(count, total, "signals"))
    rows = [row for part in found for row in part]
    return AdaptiveResults(
        [row for row in rows if isinstance(row, RateRow)], [row for row in rows if isinstance(row, MatchRow)]
    )


def _costs(given: Sequence[NamedTrace], scope: AdaptiveScope) -> list[CostRow]:
    """Run times, measured after all other work."""
    sources = recordings(given, scope) + scenes(scope, NOISE_N, [seed for seed in scope.seeds if seed == 2])
    signals = [source.signal().middle(scope.cost_ticks) for source in sources if source.key.half == "reported"]
    return [cost(variant, signals) for variant in (HYBRID, ADAPTIVE)]
