"""Rows for a terminal of 80 columns: each by itself while they are few, else the mean over traces."""

from collections.abc import Callable, Sequence
from statistics import fmean

from rich.table import Table

from weberlink.studies.evaluate.row import Row

FEW = 40
"""Rows that are still read one by one."""
NAME_WIDTH = 16
LIMIT = "limit"


def table_of(rows: Sequence[Row], jnd: float, run_time: float, footer: str) -> Table:
    """The table.

    Args:
        rows: at least one.
        jnd: of a person, as a share of the force.
        run_time: of all of them [s].
        footer: the environment in which they were made.
    """
    traces = len({row.trace for row in rows})
    summary = len(rows) > FEW and traces > 1
    limited = all(row.clairvoyant_packets is not None for row in rows)
    notes = [f"noticed: ticks with an error above a JND of {100 * jnd:g} %"]
    if limited:
        notes.append("limit: no encoder can send fewer, even knowing the future")
    notes += [f"{len(rows)} row{'s' if len(rows) > 1 else ''} in {run_time:.1f} s; {_law(rows)}"]
    if summary:
        notes.insert(0, f"means over {traces} traces; all rows: --json OUT, --plots DIR")
    table = Table(
        box=None, pad_edge=False, padding=(0, 1, 0, 0), caption="\n".join([*notes, footer]), caption_justify="left"
    )
    shaped = len({row.deadband for row in rows}) > 1
    heads = (*(() if summary else ("trace",)), *(("deadband",) if shaped else ()), "predictor", "k")
    figures = [name for name in _FIGURES if limited or name != LIMIT]
    for name in (*heads, *figures):
        table.add_column(name, justify="left" if name in ("trace", "deadband", "predictor") else "right", no_wrap=True)
    for group in _groups(rows) if summary else ([row] for row in rows):
        first = group[0]
        head = (*((first.deadband,) if shaped else ()), first.predictor, f"{first.weber:g}")
        table.add_row(*(head if summary else (_short(first.trace), *head)), *(_figure(name, group) for name in figures))
    return table


def _groups(rows: Sequence[Row]) -> list[list[Row]]:
    """Rows that differ in their trace only, in the order of their first."""
    groups: dict[tuple[str, str, float], list[Row]] = {}
    for row in rows:
        groups.setdefault((row.deadband, row.predictor, row.weber), []).append(row)
    return list(groups.values())


def _figure(name: str, rows: Sequence[Row]) -> str:
    """The mean over rows, in words."""
    of, form = _FIGURES[name]
    return form.format(fmean(of(row) for row in rows))


_FIGURES: dict[str, tuple[Callable[[Row], float], str]] = {
    "packets/s": (lambda row: row.packets_per_s, "{:.1f}"),
    LIMIT: (lambda row: row.clairvoyant_packets_per_s or 0.0, "{:.1f}"),
    "fewer": (lambda row: 100.0 * row.reduction, "{:.1f} %"),
    "RMS JND": (lambda row: row.error_rms_jnd, "{:.3f}"),
    "noticed": (lambda row: 100.0 * row.noticeable_fraction, "{:.1f} %"),
    "us/tick": (lambda row: row.tick_us, "{:.1f}"),
}


def _law(rows: Sequence[Row]) -> str:
    """Whether the codec kept its word."""
    broken = sum(row.violation_fraction > 0.0 for row in rows)
    return f"ticks outside their deadband in {broken} of them" if broken else "no tick outside its deadband"


def _short(name: str) -> str:
    """The end of a long name: that is where names differ."""
    return name if len(name) <= NAME_WIDTH else f"…{name[1 - NAME_WIDTH :]}"
