"""The `adaptive` command: runs the study in parallel and writes its page, figure and rows."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from time import perf_counter

from weberlink.codec.predictors import ADAPTIVE_BANK
from weberlink.studies import recordings
from weberlink.studies.adaptive.coding import FLOOR_N, WEBER, length, rows_of
from weberlink.studies.adaptive.comparison import SEED, by_group, ratios
from weberlink.studies.adaptive.document import CHOSEN_BY, band, document, summary
from weberlink.studies.adaptive.signals import BASE_HZ, FULL, QUICK, AdaptiveScope, signals, tasks
from weberlink.studies.evaluate.traces import ALL, NamedTrace, read_traces
from weberlink.studies.parallel import parallel_map
from weberlink.studies.result import StudyResult, how_much, plain_table
from weberlink.system.configuration.extras import need
from weberlink.system.environment import environment, footer

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
        traces: recordings, files or shipped ones by name; every shipped one if there are none.
        quick: a small part of the study.
        docs: whether page and figure will be drawn.
        workers: processes; None for one per processor.
        progress: receives the number of finished pieces, of all pieces, and their name.

    Raises:
        ConfigurationError: for a trace that cannot be used, or a missing extra; nothing was computed then.
    """
    if docs:
        need("matplotlib", "plots", "--docs")
    return study(read_traces(traces or [Path(ALL)]), QUICK if quick else FULL, workers, progress)


def study(
    given: Sequence[NamedTrace], scope: AdaptiveScope, workers: int | None, progress: Callable[[int, int, str], None]
) -> StudyResult:
    """Measure recordings, scenes and synthetic signals; arguments as of `run`."""
    began = perf_counter()
    work = tasks(signals(given, scope), scope)
    coded = parallel_map(rows_of, work, workers, length, lambda done, total: progress(done, total, "signals"))
    rows = [row for each in coded.values() for row in each]
    interrupted = how_much(len(coded), len(work), "signals")
    run_time, facts = perf_counter() - began, environment()
    caption = footer(facts, SEED)
    content = {
        "weber": WEBER,
        "floor_n": FLOOR_N,
        "bank": ADAPTIVE_BANK,
        "scope": scope._asdict(),
        "chosen_by": CHOSEN_BY,
        "chose": {name: source.chose for name, source in recordings.SOURCES.items()},
        "groups": [asdict(one) for one in by_group(ratios(rows))],
        "rows": [asdict(row) for row in rows],
        "seed": SEED,
        "run_time_s": run_time,
        "environment": facts,
    }

    def draw(folder: Path) -> None:
        from weberlink.studies.adaptive.figures import draw as draw_figure  # noqa: PLC0415 - slow import

        (folder / NUMBERS).write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        draw_figure(rows, folder, caption)
        (folder / PAGE).write_text(document(rows, scope, caption, drawn=True), encoding="utf-8")

    rate = BASE_HZ if BASE_HZ in scope.rates_hz else scope.rates_hz[0]
    table = plain_table(
        f"{rate} Hz", "n", "packets/s", "over hybrid", "over best", "lost", padding=(0, 1, 0, 0),
        caption=f"packets of adaptive; lost: 1.05 of the best single predictor and 1/s more\n{caption}",
    )  # fmt: skip
    for one in summary(rows, rate):
        table.add_row(
            one.name, str(one.signals), f"{one.per_s:.1f}", band(one.over_hybrid), f"{one.over_best.mean:.2f}",
            f"{100 * one.lost:.0f} %",
        )  # fmt: skip
    return StudyResult(content, table, None if interrupted else draw, interrupted=interrupted)
