"""The tables of `weberlink study evaluate` in 80 columns: single rows while they are few, and figures by source."""

from typing import TYPE_CHECKING

from rich.console import Group, RenderableType

from weberlink_studies.evaluate.by_source import EVERY, MOST, SINGLES, by_source
from weberlink_studies.result import Column, frame_table

if TYPE_CHECKING:
    from pandas import DataFrame

FEW = 40  # up to this number, every row is printed
NAME_WIDTH = 15  # of a longer trace name the end is shown, where names differ

WAYS = {
    "deadband": Column("deadband", left=True),
    "predictor": Column("predictor", left=True),
    "weber": Column("k", "{:g}"),
}
SINGLE = {
    "trace": Column("trace", lambda name: name if len(name) <= NAME_WIDTH else f"…{name[1 - NAME_WIDTH :]}"),
    **WAYS,
    "packets_per_s": Column("packets/s", "{:.1f}"),
    "error_rms_jnd": Column("RMS JND", "{:.3f}"),
    "jump_p99_jnd": Column("jump JND", "{:.1f}"),
    "noticeable_fraction": Column("noticed", lambda share: f"{100 * share:.1f} %"),
    "tick_us": Column("us/tick", "{:.1f}"),
}
SOURCES = {
    "source": Column("source"),
    **WAYS,
    "recordings": Column("n"),
    "packets_per_s": Column("packets/s", "{:.1f}"),
    "bytes_per_s": Column("B/s", "{:.0f}"),
    "over_hybrid": Column("/hybrid", "{:.3f}"),
    "over_best": Column("/best", "{:.3f}"),
    "above": Column(f">{MOST:g}", "{:.0%}"),
    "error_rms_jnd": Column("RMS JND", "{:.3f}"),
}

POSITION = {
    "predictor": Column("predictor"),
    "weber": Column("k", "{:g}"),
    "packets_per_s": Column("packets/s", "{:.1f}"),
    "bytes_per_s": Column("B/s", "{:.0f}"),
    "error_rms_m": Column("RMS mm", lambda metres: f"{1e3 * metres:.3f}"),
    "error_max_m": Column("max mm", lambda metres: f"{1e3 * metres:.2f}"),
    "tick_us": Column("us/tick", "{:.1f}"),
}


def tables_of(rows: "DataFrame", jnd: float, run_time: float, footer: str) -> RenderableType:
    """The tables of at least one row; the run time is that of all rows [s]."""
    all_rows = rows
    positions, rows = rows[rows.channel == "position"], rows[rows.channel == "force"]
    many, alike = rows.trace.nunique() > 1, rows.deadband.nunique() == 1
    broken = int((all_rows.violation_fraction > 0.0).sum())
    violations = f"ticks outside their deadband in {broken} of them" if broken else "no tick outside its deadband"
    count = len(rows) + len(positions)
    notes = [f"{count} row{'s' if count > 1 else ''} in {run_time:.1f} s; {violations}", footer]
    if "widened_max_n" in rows:
        widened, most = 100 * rows.widened_fraction.max(), rows.widened_max_n.max()
        notes.insert(0, f"deadband widened in up to {widened:.1f} % of ticks, to at most {most:.3f} N")
    parts = []
    if len(rows) <= FEW or not many:
        told = f"noticed: ticks with an error above a JND of {100 * jnd:g} %; jump: 99th percentile, at updates"
        columns = {
            name: column for name, column in SINGLE.items() if name in rows and not (alike and name == "deadband")
        }
        parts.append(frame_table(rows, columns, notes=[told, *([] if many else notes)]))
    if many:
        found = by_source(rows)
        told = f"geometric means over recordings{f'; {EVERY}: over sources' if EVERY in set(found.source) else ''}"
        best = f"/best: over the best of {', '.join(SINGLES)}; >{MOST:g}: recordings above"
        columns = {name: column for name, column in SOURCES.items() if not (alike and name == "deadband")}
        notes = [told, best, "all rows: --json OUT, --csv OUT", *notes]
        parts.append(frame_table(found, columns, notes=notes))
    if len(positions):
        means = positions.groupby(["predictor", "weber"], sort=False)[list(POSITION)[2:]].mean().reset_index()
        parts.append(frame_table(means, POSITION, title="position channel, means over traces"))
    return Group(*parts[::-1])  # the notes stand last
