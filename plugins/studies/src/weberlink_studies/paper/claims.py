"""The claims of the paper, judged on each source of recordings and on each simulated scene by itself.

Recordings of one source come from one rig and are alike, so they count together as one, without an interval; a mean
over sources or scenes would be that of an arbitrary choice. The quality is the RMS error of the force in JNDs.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, inf, isfinite, log, nan
from typing import TYPE_CHECKING, Literal

import numpy as np

from weberlink.codec.choice import HYBRID, Hybrid

if TYPE_CHECKING:
    from pandas import DataFrame

PREDICTORS = (*Hybrid.bank("force"), HYBRID)  # the predictors of the paper
WEBERS = (0.025, 0.05, 0.10, 0.15, 0.20, 0.30)  # the Weber factors of the paper
WEBER = 0.10  # the paper compares packet rates at this Weber factor; the quality at it is the one that is held equal
EASY = 0.95  # saved share from which a signal is predicted almost without an error, so that it decides nothing
HOLDS, FAILS, TOO_EASY, NO_CLAIM, UNMEASURED = "holds", "fails", "too easy", "no claim", "not measured"


@dataclass(frozen=True)
class Claim:
    """One predictor sends fewer packets than another."""

    predictor: str  # sends less
    reference: str  # sends more
    # what is held equal: the Weber factor (`WEBER`), or the quality of the reference at `WEBER`
    at: Literal["weber", "quality"]
    fewer: float  # saved share of the packets of the reference


CLAIMS = (
    Claim("plane", "zoh", "weber", 0.31),
    Claim("sphere", "zoh", "weber", 0.18),
    Claim("hybrid", "zoh", "weber", 0.42),
    Claim("plane", "zoh", "quality", 0.60),
    Claim("sphere", "zoh", "quality", 0.60),
    Claim("plane", "linear", "quality", 0.54),
    Claim("sphere", "linear", "quality", 0.54),
    Claim("hybrid", "plane", "quality", 0.15),
)
"""The paper states 60 and 54 % for "geometry-based" prediction; both geometries are compared."""


def judge(rows: "DataFrame", signals: int) -> "DataFrame":
    """Every claim on every source or scene.

    Args:
        rows: condition, source, surface, signal, predictor, weber, packets_per_s and error_rms_jnd.
        signals: rows of a complete signal; signals with fewer are left out.

    Returns:
        For each condition, source, whether it has a surface, and claim: number of signals that could be compared,
        fewer (saved share, geometric mean over them, NaN without any), unreached (those where the predictor reaches
        the quality of the reference at none of its Weber factors), at_least (whether it is better at all of them on
        one, so that the saving is a lower bound), and verdict. Without a surface the paper claims nothing.
    """
    from pandas import DataFrame  # noqa: PLC0415 - heavy, an extra

    complete = rows.groupby(["condition", "signal"]).filter(lambda mine: len(mine) == signals)
    found = []
    for (condition, source, surface), part in complete.groupby(["condition", "source", "surface"], sort=False):
        for claim in CLAIMS:
            ratios = [_ratio(mine, claim) for _, mine in part.groupby("signal", sort=False)]
            compared = [ratio for ratio, _ in ratios if isfinite(ratio)]
            unreached = sum(ratio == inf for ratio, _ in ratios)
            fewer = 1.0 - exp(np.mean(np.log(compared))) if compared else nan
            found.append(
                {
                    "condition": condition,
                    "source": source,
                    "surface": surface,
                    "predictor": claim.predictor,
                    "reference": claim.reference,
                    "at": claim.at,
                    "claimed": claim.fewer,
                    "signals": len(compared),
                    "fewer": fewer,
                    "unreached": unreached,
                    "at_least": any(is_bound for _, is_bound in ratios),
                    "verdict": verdict(claim.fewer, fewer, unreached) if surface else NO_CLAIM,
                }
            )
    return DataFrame(found, columns=None if found else ["condition", "source", "surface", "signals"])


def verdict(claimed: float, fewer: float, unreached: int) -> str:
    """The verdict on a claim where `fewer` packets are sent; NaN if no signal could be compared."""
    if unreached:
        return FAILS
    if not isfinite(fewer):
        return UNMEASURED
    if fewer >= EASY:
        return TOO_EASY
    return HOLDS if fewer >= claimed else FAILS


def _ratio(mine: "DataFrame", claim: Claim) -> tuple[float, bool]:
    """Packets of the predictor per packet of the reference on one signal, and whether that is an upper bound.

    NaN where one of them sends nothing, infinite where the predictor never reaches the quality of the reference.
    """
    by_predictor = {name: part.sort_values("weber") for name, part in mine.groupby("predictor")}
    reference = by_predictor[claim.reference].set_index("weber").loc[WEBER]
    points = by_predictor[claim.predictor]
    if claim.at == "weber":
        rate, is_bound = float(points.set_index("weber").loc[WEBER].packets_per_s), False
    else:
        curve = list(zip(points.error_rms_jnd, points.packets_per_s, strict=True))
        rate, is_bound = rate_at(curve, reference.error_rms_jnd)
    if reference.packets_per_s <= 0.0 or rate <= 0.0:
        return nan, False
    return rate / reference.packets_per_s, is_bound


def rate_at(points: Sequence[tuple[float, float]], error: float) -> tuple[float, bool]:
    """The packet rate at which a curve reaches an error, and whether it is the last of a curve that is better.

    Interpolates between neighbouring Weber factors, linear in the error and logarithmic in the rate. Of several
    crossings the one with the largest Weber factor counts, which needs the fewest packets.

    Args:
        points: error and rate by rising Weber factor, at least one; the error mostly rises with it.
        error: > 0.

    Returns:
        Infinity where even the smallest Weber factor is worse; the last rate and True where even the largest is better.
    """
    if points[-1][0] <= error:
        return points[-1][1], points[-1][0] < error
    for (near, rate_near), (far, rate_far) in zip(points[-2::-1], points[:0:-1], strict=True):
        if near <= error <= far:
            share = (error - near) / (far - near) if far > near else 0.0
            if rate_near <= 0.0 or rate_far <= 0.0:
                return rate_near + share * (rate_far - rate_near), False
            return exp(log(rate_near) + share * (log(rate_far) - log(rate_near))), False
    return inf, False
