"""Figures by source: geometric means over the recordings of a source, then over sources, which are not pooled.

Recordings of one source are alike, and sources have very different numbers of them: a mean over all recordings would be
that of the largest source.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from weberlink.codec.predictors import HYBRID

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
