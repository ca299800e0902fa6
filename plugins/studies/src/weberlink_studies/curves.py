"""Packet rate and quality over the Weber factor: means over traces or subjects with confidence intervals.

The intervals are percentile intervals of a bootstrap over units (Efron and Tibshirani, An Introduction to the
Bootstrap, 1993). A unit is drawn with all of its observations, because those of one trace or person are dependent. With
few units the interval is somewhat too narrow.
"""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pandas import DataFrame

RESAMPLES = 10_000
CONFIDENCE = 0.95
RATE = "packets_per_s"
ENDS = ("mean", "low", "high")


def curves(observed: "DataFrame", quality: str, *, resamples: int = RESAMPLES, seed: int = 0) -> "DataFrame":
    """Means over units with 95 % confidence intervals.

    Every resample uses the same units for all predictors and Weber factors, so that bands of the same seed can be
    compared. The order of the observations does not matter. With one unit, low = high = mean.

    Args:
        observed: columns unit, predictor, weber, packets_per_s and the quality: every unit with every combination of
            predictor and Weber factor that occurs. Several of one unit and combination are averaged first, so that a
            unit counts once.
        quality: name of its column, such as "rating".
        resamples: 0 for no interval.
        seed: of the bootstrap.

    Returns:
        One row for each predictor in order of first appearance and Weber factor: predictor, weber, units, and mean,
        low and high of both quantities, such as `rating_mean`.

    Raises:
        ValueError: a number is not finite, or a unit lacks a combination.
    """
    from pandas import DataFrame  # noqa: PLC0415 - heavy, an extra
    from scipy import stats  # noqa: PLC0415

    wrong = observed[~np.isfinite(observed[["weber", RATE, quality]]).all(axis=1)]
    if len(wrong):
        raise ValueError(f"{_name(*wrong.iloc[0][['unit', 'predictor', 'weber']])}: expected finite numbers")
    table = observed.pivot_table(index="unit", columns=["predictor", "weber"], values=[RATE, quality])
    lacking = table.index[table.isna().any(axis=1)]
    if len(lacking):
        combination = table.columns[table.loc[lacking[0]].isna()][0][1:]
        raise ValueError(
            f"{_name(lacking[0], *combination)}: not observed; expected every unit with every predictor and Weber "
            f"factor, which {len(lacking)} of {len(table)} lack"
        )
    values = table.to_numpy()
    low = high = mean = values.mean(axis=0)
    if len(values) > 1 and resamples:
        ends = stats.bootstrap(
            (values,), np.mean, axis=0, n_resamples=resamples, batch=1000, method="percentile", rng=seed
        ).confidence_interval
        # Rounding may put the ends of a zero-width band on the wrong side of the mean.
        low, high = np.minimum(ends.low, mean), np.maximum(ends.high, mean)
    found = DataFrame(dict(zip(ENDS, (mean, low, high), strict=True)), index=table.columns).unstack(0)
    found.columns = [f"{quantity}_{end}" for end, quantity in found.columns]
    found = found.reindex(observed.predictor.unique(), level="predictor").reset_index()
    found.insert(2, "units", len(values))
    return found[["predictor", "weber", "units", *(f"{name}_{end}" for name in (RATE, quality) for end in ENDS)]]


def _name(unit: str, predictor: str, weber: float) -> str:
    return f"{unit}, {predictor} at k = {weber:g}"
