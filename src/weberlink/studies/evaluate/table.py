"""The table of `weberlink evaluate` in 80 columns: single rows while they are few, else means over traces."""

from collections.abc import Callable, Sequence
from statistics import fmean

from rich.table import Table

from weberlink.studies.evaluate.study import EvaluationRow
from weberlink.studies.result import plain_table

FEW = 40
"""Up to this number, every row is printed."""
NAME_WIDTH = 16
"""Of a longer trace name the end is shown, where names differ."""
LIMIT = "limit"

_FIGURES: dict[str, tuple[Callable[[EvaluationRow], float], str]] = {
    "packets/s": (lambda row: row.packets_per_s, "{:.1f}"),
    LIMIT: (lambda row: row.clairvoyant_packets_per_s or 0.0, "{:.1f}"),
    "fewer": (lambda row: 100.0 * row.reduction, "{:.1f} %"),
    "RMS JND": (lambda row: row.error_rms_jnd, "{:.3f}"),
    "noticed": (lambda row: 100.0 * row.noticeable_fraction, "{:.1f} %"),
    "us/tick": (lambda row: row.tick_us, "{:.1f}"),
}
_HEADS: dict[str, Callable[[EvaluationRow], str]] = {
    "trace": lambda row: row.trace if len(row.trace) <= NAME_WIDTH else f"…{row.trace[1 - NAME_WIDTH :]}",
    "deadband": lambda row: row.deadband,
    "predictor": lambda row: row.predictor,
    "k": lambda row: f"{row.weber:g}",
}


def table_of(rows: Sequence[EvaluationRow], jnd: float, run_time: float, footer: str) -> Table:
    """The table of at least one row; the run time is that of all rows [s]."""
    traces = len({row.trace for row in rows})
    averaged = len(rows) > FEW and traces > 1
    shaped = len({row.deadband for row in rows}) > 1
    limited = all(row.clairvoyant_packets is not None for row in rows)
    notes = [f"means over {traces} traces; all rows: --json OUT, --plots DIR"] if averaged else []
    notes.append(f"noticed: ticks with an error above a JND of {100 * jnd:g} %")
    if widened := max((row.widened_fraction or 0.0 for row in rows), default=0.0):
        most = max(row.widened_max_n or 0.0 for row in rows)
        notes.append(f"deadband widened in up to {100 * widened:.1f} % of ticks, to at most {most:.3f} N")
    if limited:
        notes.append("limit: no encoder can send fewer, even knowing the future")
    notes.append(f"{len(rows)} row{'s' if len(rows) > 1 else ''} in {run_time:.1f} s; {_violations(rows)}")
    heads = [name for name in _HEADS if (name != "trace" or not averaged) and (name != "deadband" or shaped)]
    figures = [name for name in _FIGURES if limited or name != LIMIT]
    table = plain_table(
        *heads, *figures, left=("deadband", "predictor"), padding=(0, 1, 0, 0), caption="\n".join([*notes, footer])
    )
    for group in _groups(rows) if averaged else ([row] for row in rows):
        means = (form.format(fmean(of(row) for row in group)) for of, form in (_FIGURES[name] for name in figures))
        table.add_row(*(_HEADS[name](group[0]) for name in heads), *means)
    return table


def _groups(rows: Sequence[EvaluationRow]) -> list[list[EvaluationRow]]:
    """Rows that differ only in their trace, in the order of their first."""
    groups: dict[tuple[str, str, float], list[EvaluationRow]] = {}
    for row in rows:
        groups.setdefault((row.deadband, row.predictor, row.weber), []).append(row)
    return list(groups.values())


def _violations(rows: Sequence[EvaluationRow]) -> str:
    broken = sum(row.violation_fraction > 0.0 for row in rows)
    return f"ticks outside their deadband in {broken} of them" if broken else "no tick outside its deadband"
