"""The claims of the paper, and how measurements compare with them: packets saved at equal Weber factor or quality.

A unit is a recorded trace or a simulated scene; its quality is an error, the smaller the better.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import exp, log
from typing import Any, Literal

from weberlink.codec.predictors import HYBRID, HYBRID_BANK
from weberlink.studies.curves import Band, Observation, curves

PREDICTORS = (*HYBRID_BANK, HYBRID)
"""The predictors of the paper."""
WEBERS = (0.025, 0.05, 0.10, 0.15, 0.20, 0.30)
"""The Weber factors of the paper."""
WEBER = 0.10
"""The paper compares packet rates at this Weber factor; the quality at it is the one that is held equal."""

LEAST_UNITS = 2
"""With fewer units there is no interval."""

QualityCurve = list[tuple[float, float]]
"""Quality and packet rate, by rising Weber factor."""


@dataclass(frozen=True)
class Claim:
    """One predictor sends fewer packets than another.

    Args:
        predictor: sends less.
        reference: sends more.
        at: what is held equal: the Weber factor (`WEBER`), or the quality of the reference at `WEBER`.
        fewer: saved share of the packets of the reference.
    """

    predictor: str
    reference: str
    at: Literal["weber", "quality"]
    fewer: float

    @property
    def conditions(self) -> str:
        return f"k = {WEBER:.2f}" if self.at == "weber" else "equal quality"


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


@dataclass(frozen=True)
class ClaimResult:
    """The measurement of a claim under one condition.

    Args:
        claim: the claim.
        units: number of units that could be compared.
        fewer: saved share of packets, geometric mean over units with its 95 % confidence interval; None without units.
        ratios: packets of the predictor per packet of the reference, by unit.
        unreached: units where the predictor reaches the quality of the reference at none of its Weber factors.
        clipped: units where it is better at all of them; its fewest packets count, so the saving is a lower bound.
    """

    claim: Claim
    units: int
    fewer: Band | None
    ratios: dict[str, float]
    unreached: tuple[str, ...]
    clipped: tuple[str, ...]

    @property
    def failing(self) -> tuple[str, ...]:
        """Units where the predictor sends no less than the reference, the worst first."""
        units = (unit for unit, ratio in self.ratios.items() if ratio >= 1.0)
        return tuple(sorted(units, key=lambda unit: -self.ratios[unit]))

    @property
    def signals(self) -> int:
        """Number of units that the claim was tried on, with those that never reach the quality."""
        return self.units + len(self.unreached)

    @property
    def verdict(self) -> str:
        """ "holds" if the whole interval saves as much as claimed, "fails" if all of it saves less."""
        if self.fewer is None:
            return "not measured"
        if self.units < LEAST_UNITS:
            return "undecided"
        if self.fewer.low >= self.claim.fewer:
            return "holds"
        return "fails" if self.fewer.high < self.claim.fewer else "undecided"

    def as_json(self) -> dict[str, Any]:
        fewer = self.fewer
        return {
            "predictor": self.claim.predictor,
            "reference": self.claim.reference,
            "at": self.claim.at,
            "claimed": self.claim.fewer,
            "units": self.units,
            "measured": None if fewer is None else fewer.mean,
            "measured_low": None if fewer is None else fewer.low,
            "measured_high": None if fewer is None else fewer.high,
            "verdict": self.verdict,
            "never_reach_the_quality": len(self.unreached),
            "ratios": self.ratios,
            "unreached": list(self.unreached),
            "clipped": list(self.clipped),
        }


def measure(claim: Claim, observations: Sequence[Observation]) -> ClaimResult:
    """Measure a claim on units observed with both predictors at several Weber factors.

    Units without a packet of either predictor are left out.
    """
    ratios: dict[str, float] = {}
    unreached, clipped = [], []
    for unit in dict.fromkeys(one.unit for one in observations):
        mine = [one for one in observations if one.unit == unit]
        reference = next((one for one in mine if (one.predictor, one.weber) == (claim.reference, WEBER)), None)
        if reference is None or reference.packets_per_s <= 0.0:
            continue
        if claim.at == "weber":
            rate = next((o.packets_per_s for o in mine if (o.predictor, o.weber) == (claim.predictor, WEBER)), None)
        else:
            rate, is_clipped = rate_at(curve(mine, claim.predictor), reference.quality)
            if rate is None:
                unreached.append(unit)
            if is_clipped:
                clipped.append(unit)
        if rate is not None and rate > 0.0:
            ratios[unit] = rate / reference.packets_per_s
    band = ratio_band(ratios)
    fewer = None if band is None else Band(1.0 - band.mean, 1.0 - band.high, 1.0 - band.low)
    return ClaimResult(claim, len(ratios), fewer, ratios, tuple(unreached), tuple(clipped))


def curve(observations: Iterable[Observation], predictor: str) -> QualityCurve:
    """Quality and packet rate of one predictor on one unit."""
    mine = sorted((one for one in observations if one.predictor == predictor), key=lambda one: one.weber)
    return [(one.quality, one.packets_per_s) for one in mine]


def rate_at(points: QualityCurve, error: float) -> tuple[float | None, bool]:
    """The packet rate at which a curve reaches an error, and whether the rate is clipped to the last of the curve.

    Interpolates between neighbouring Weber factors, linear in the error and logarithmic in the rate. Of several
    crossings the one with the largest Weber factor counts, which needs the fewest packets.

    Args:
        points: by rising Weber factor; the error mostly rises with it.
        error: > 0.

    Returns:
        None where even the smallest Weber factor is worse; the last rate and True where even the largest is better.
    """
    if not points:
        return None, False
    if points[-1][0] <= error:
        return points[-1][1], points[-1][0] < error
    for (near, rate_near), (far, rate_far) in zip(points[-2::-1], points[:0:-1], strict=True):
        if near <= error <= far:
            share = (error - near) / (far - near) if far > near else 0.0
            if rate_near <= 0.0 or rate_far <= 0.0:
                return rate_near + share * (rate_far - rate_near), False
            return exp(log(rate_near) + share * (log(rate_far) - log(rate_near))), False
    return None, False


def ratio_band(ratios: Mapping[str, float]) -> Band | None:
    """Geometric mean of ratios > 0 by unit, and its 95 % confidence interval; None without any."""
    if not ratios:
        return None
    logs = [Observation(unit, "", WEBER, ratio, log(ratio)) for unit, ratio in ratios.items()]
    ((point,),) = curves(logs).values()
    mean, low, high = point.quality
    return Band(exp(mean), exp(low), exp(high))
