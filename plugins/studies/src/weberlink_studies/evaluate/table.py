"""The tables of `weberlink study evaluate` in 80 columns: single rows while they are few, and figures by source.

Figures by source are geometric means over the recordings of a source, then over sources, which are not pooled:
recordings of one source are alike, and a mean over all would be that of the source with most.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Group, RenderableType

from weberlink.codec.choice import HYBRID
from weberlink_studies.result import Column, frame_table

if TYPE_CHECKING:
    from pandas import DataFrame

SINGLES = ("zoh", "linear", "plane", "sphere")
"""Predictors of the paper; the best of them on a recording is a reference."""
MOST = 1.05  # packets over those of the best single predictor above which a recording counts as a loss
MORE_PER_S = 1.0  # and so many packets per second more: with few packets, one more is a large share
EVERY = "sources"  # name of the geometric mean over sources
KEYS = ["predictor", "weber", "deadband"]
RATIOS = ["packets_per_s", "bytes_per_s", "over_hybrid", "over_best"]


def by_source(rows: "DataFrame") -> "DataFrame":
    """Figures of each source, then those over all sources if there are several, for every combination of `KEYS`.

    `packets_per_s`, `bytes_per_s` and the ratios of packets are geometric means; `over_best` is over the best of
    `SINGLES` on each recording, `above` the share of recordings with more than `MOST` of that, `above_by` of those
    that also send more than `MORE_PER_S` more; `error_rms_jnd` is a mean. What lacks a row to compare with is missing.
    """
    import pandas as pd  # noqa: PLC0415 - heavy, an extra

    rate = rows.packets.clip(lower=1) / rows.duration_s  # at least one packet, which a ratio needs
    alike = ["trace", "weber", "deadband"]
    rates = rows.assign(rate=rate).pivot(index=alike, columns="predictor", values="rate")
    rates = rates.reindex(columns=[*dict.fromkeys([*SINGLES, HYBRID])])
    best = rates[list(SINGLES)].min(axis=1, skipna=False)
    index = pd.MultiIndex.from_frame(rows[alike])
    hybrid, best = rates[HYBRID].reindex(index).to_numpy(), best.reindex(index).to_numpy()
    figures = rows[[*KEYS, "source"]].assign(
        recordings=1,
        packets_per_s=rate,
        bytes_per_s=np.maximum(rows.bytes_per_s, 1.0 / rows.duration_s),
        over_hybrid=rate / hybrid,
        over_best=rate / best,
        above=np.where(np.isnan(best), np.nan, rate > MOST * best),
        above_by=np.where(np.isnan(best), np.nan, rate > np.maximum(MOST * best, best + MORE_PER_S)),
        error_rms_jnd=rows.error_rms_jnd,
    )
    found = _means(figures, ["source", *KEYS])
    if found.source.nunique() > 1:
        found = pd.concat([found, _means(found, KEYS).assign(source=EVERY)], ignore_index=True)
    return found


def _means(figures: "DataFrame", keys: list[str]) -> "DataFrame":
    """Means over the rows of equal keys, in the order of appearance; missing where one of the figures is."""

    def mean(group: Any) -> Any:
        return group.mean(skipna=False)

    logarithms = figures.assign(**{name: np.log(figures[name]) for name in RATIOS})
    others = ["above", "above_by", "error_rms_jnd"]
    ways = {"recordings": "sum", **dict.fromkeys([*RATIOS, *others], mean)}
    found = logarithms.groupby(keys, sort=False).agg(ways).reset_index()
    return found.assign(**{name: np.exp(found[name]) for name in RATIOS})


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
