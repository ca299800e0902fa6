"""The tables of `weberlink study evaluate` in 80 columns: single rows while they are few, and figures by source."""

from collections.abc import Callable, Sequence

from rich.console import Group, RenderableType
from rich.table import Table

from weberlink.studies.evaluate.by_source import EVERY, MOST, SINGLES, SourceFigures, by_source
from weberlink.studies.evaluate.study import EvaluationRow
from weberlink.studies.result import plain_table

FEW = 40
"""Up to this number, every row is printed."""
NAME_WIDTH = 15
"""Of a longer trace name the end is shown, where names differ."""

_FIGURES: dict[str, tuple[Callable[[EvaluationRow], float], str]] = {
    "packets/s": (lambda row: row.packets_per_s, "{:.1f}"),
    "RMS JND": (lambda row: row.error_rms_jnd, "{:.3f}"),
    "jump JND": (lambda row: row.jump_p99_jnd or 0.0, "{:.1f}"),
    "noticed": (lambda row: 100.0 * row.noticeable_fraction, "{:.1f} %"),
    "us/tick": (lambda row: row.tick_us, "{:.1f}"),
}
_HEADS: dict[str, Callable[[EvaluationRow], str]] = {
    "trace": lambda row: row.trace if len(row.trace) <= NAME_WIDTH else f"…{row.trace[1 - NAME_WIDTH :]}",
    "deadband": lambda row: row.deadband,
    "predictor": lambda row: row.predictor,
    "k": lambda row: f"{row.weber:g}",
}


def tables_of(rows: Sequence[EvaluationRow], jnd: float, run_time: float, footer: str) -> RenderableType:
    """The tables of at least one row; the run time is that of all rows [s]."""
    many = len({row.trace for row in rows}) > 1
    notes = [f"{len(rows)} row{'s' if len(rows) > 1 else ''} in {run_time:.1f} s; {_violations(rows)}", footer]
    if widened := max((row.widened_fraction or 0.0 for row in rows), default=0.0):
        most = max(row.widened_max_n or 0.0 for row in rows)
        notes.insert(0, f"deadband widened in up to {100 * widened:.1f} % of ticks, to at most {most:.3f} N")
    parts: list[Table] = []
    if len(rows) <= FEW or not many:
        parts.append(_single(rows, jnd, [] if many else notes))
    if many:
        parts.append(_by_source(by_source(rows), notes))
    return Group(*parts)


def _single(rows: Sequence[EvaluationRow], jnd: float, notes: Sequence[str]) -> Table:
    shaped = len({row.deadband for row in rows}) > 1
    heads = [name for name in _HEADS if name != "deadband" or shaped]
    caption = f"noticed: ticks with an error above a JND of {100 * jnd:g} %; jump: 99th percentile, at updates"
    table = plain_table(
        *heads, *_FIGURES, left=("deadband", "predictor"), padding=(0, 1, 0, 0), caption="\n".join([caption, *notes])
    )
    for row in rows:
        values = (form.format(of(row)) for of, form in _FIGURES.values())
        table.add_row(*(_HEADS[name](row) for name in heads), *values)
    return table


def _by_source(found: Sequence[SourceFigures], notes: Sequence[str]) -> Table:
    shaped = len({one.deadband for one in found}) > 1
    heads = ("source", *(("deadband",) if shaped else ()), "predictor", "k", "n")
    figures = ("packets/s", "B/s", "/hybrid", "/best", f">{MOST:g}", "RMS JND")
    several = any(one.source == EVERY for one in found)
    caption = [
        f"geometric means over recordings{f'; {EVERY}: over sources' if several else ''}",
        f"/best: over the best of {', '.join(SINGLES)}; >{MOST:g}: recordings above",
        "all rows: --json OUT, --csv OUT",
    ]
    table = plain_table(
        *heads, *figures, left=("deadband", "predictor"), padding=(0, 1, 0, 0), caption="\n".join([*caption, *notes])
    )
    for one in found:
        table.add_row(
            one.source,
            *((one.deadband,) if shaped else ()),
            one.predictor,
            f"{one.weber:g}",
            str(one.recordings),
            f"{one.packets_per_s:.1f}",
            f"{one.bytes_per_s:.0f}",
            *("-" if value is None else f"{value:.3f}" for value in (one.over_hybrid, one.over_best)),
            "-" if one.above is None else f"{100 * one.above:.0f} %",
            f"{one.error_rms_jnd:.3f}",
        )
    return table


def _violations(rows: Sequence[EvaluationRow]) -> str:
    broken = sum(row.violation_fraction > 0.0 for row in rows)
    return f"ticks outside their deadband in {broken} of them" if broken else "no tick outside its deadband"
