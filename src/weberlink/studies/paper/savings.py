"""How much less one predictor sends than another: over units, with confidence, and where it does not.

Owns the comparison at equal Weber factor and at equal quality. A unit is a recorded trace or a simulated scene; what
the quality is (an error: the smaller, the better) and where the numbers come from it does not know.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import exp, log
from typing import Any

from weberlink.studies.curves import Band, Observation, curves
from weberlink.studies.paper.claims import WEBER, Claim

Curve = list[tuple[float, float]]
"""Quality and packet rate, by rising Weber factor."""


@dataclass(frozen=True)
class Saving:
    """What became of a claim under one condition.

    Args:
        claim: which.
        units: how many could be compared.
        fewer: share of packets saved, in the geometric mean over units, with its 95 % confidence; None without units.
        ratios: packets of the predictor per packet of the reference, by unit.
        unreached: units in which the predictor comes to the reference's quality at none of its Weber factors.
        clipped: units in which it is better at all of them; its fewest packets count, so it saves at least as much.
    """

    claim: Claim
    units: int
    fewer: Band | None
    ratios: dict[str, float]
    unreached: tuple[str, ...]
    clipped: tuple[str, ...]

    @property
    def failing(self) -> tuple[str, ...]:
        """Units in which the predictor sends no less than the reference, the worst first."""
        return tuple(sorted((unit for unit, ratio in self.ratios.items() if ratio >= 1.0), key=self._ratio))

    def _ratio(self, unit: str) -> float:
        return -self.ratios[unit]

    @property
    def verdict(self) -> str:
        """How the measurement stands to the claim."""
        if self.fewer is None:
            return "not measured"
        if self.fewer.mean >= self.claim.fewer:
            return "holds"
        if self.fewer.high >= self.claim.fewer:
            return "within the confidence"
        return "saves less" if self.fewer.low > 0.0 else "no saving shown"

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
            "ratios": self.ratios,
            "unreached": list(self.unreached),
            "clipped": list(self.clipped),
        }


def saving(claim: Claim, observations: Sequence[Observation]) -> Saving:
    """Measure a claim on units that were each observed with both predictors at several Weber factors.

    A unit without a packet of either predictor says nothing and is left out.
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
    return Saving(claim, len(ratios), _band(claim, ratios), ratios, tuple(unreached), tuple(clipped))


def curve(observations: Iterable[Observation], predictor: str) -> Curve:
    """Quality and packet rate of one predictor on one unit."""
    mine = sorted((one for one in observations if one.predictor == predictor), key=lambda one: one.weber)
    return [(one.quality, one.packets_per_s) for one in mine]


def rate_at(points: Curve, error: float) -> tuple[float | None, bool]:
    """The packet rate at which a curve comes to an error, and whether it is the last of a curve that never does.

    Interpolated between neighbouring Weber factors: linear in the error, logarithmic in the rate. Where the curve
    crosses more than once the largest Weber factor counts, which is the cheapest way to that quality.

    Args:
        points: by rising Weber factor; the error mostly rises with it.
        error: to come to, > 0.

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


def _band(claim: Claim, ratios: dict[str, float]) -> Band | None:
    """The saving in the geometric mean of the ratios; a larger ratio is a smaller saving."""
    if not ratios:
        return None
    logs = [Observation(unit, claim.predictor, WEBER, ratio, log(ratio)) for unit, ratio in ratios.items()]
    ((point,),) = curves(logs).values()
    mean, low, high = point.quality
    return Band(1.0 - exp(mean), 1.0 - exp(high), 1.0 - exp(low))
