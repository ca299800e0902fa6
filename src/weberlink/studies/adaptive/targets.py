"""Targets of `adaptive`, judged on the held-out signals."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from weberlink.codec.predictors import ADAPTIVE, HYBRID
from weberlink.studies.adaptive.comparison import (
    AdaptiveResults,
    MatchRow,
    RateRow,
    SignalRatio,
    against_best,
    felt_ratios,
    geometric_mean,
    ratios,
)
from weberlink.studies.adaptive.signals import FRICTION_AND_MOTION
from weberlink.studies.adaptive.variants import FLOOR_N, SINGLES
from weberlink.studies.adaptive.work import RATES, UNSEEN
from weberlink.studies.curves import Band

MOST = 0.8
MOST_WITH_FRICTION = 0.6
MOST_US = 40.0


@dataclass(frozen=True)
class AdaptiveTarget:
    """A target, its limit and the result as text; `met` is None where nothing was measured."""

    what: str
    asked: str
    found: str
    met: bool | None


def targets(results: AdaptiveResults) -> list[AdaptiveTarget]:
    """All targets, in the order in which they were set."""
    reported = results.of(RATES, half="reported", floor_n=FLOOR_N)
    return [
        _packets(reported),
        _best(reported),
        *_felt(results.matches),
        *_friction(results),
        _laws(results),
        _cost(results),
    ]


def seed_ratios(results: AdaptiveResults, scene: str) -> list[SignalRatio]:
    """Packets of `adaptive` over those of the hybrid in a scene, for each held-out seed."""
    first = results.of(RATES, half="reported", floor_n=FLOOR_N, group=scene)
    return ratios(first + results.of(UNSEEN, group=scene), ADAPTIVE, HYBRID)


def seed_mean(found: Sequence[SignalRatio]) -> float | None:
    """Geometric mean over the seeds of one scene, each counted by itself."""
    mean = geometric_mean([SignalRatio(one.signal, one.signal, one.value) for one in found])
    return None if mean is None else mean.mean


def value_range(found: Sequence[SignalRatio]) -> str:
    """The smallest and the largest ratio as text."""
    values = [one.value for one in found]
    return f"{min(values):.2f} to {max(values):.2f}"


def band(found: Band | None, digits: int = 2) -> str:
    """A mean with its interval as text."""
    if found is None:
        return "-"
    return f"{found.mean:.{digits}f} ({found.low:.{digits}f} to {found.high:.{digits}f})"


def _packets(rows: Sequence[RateRow]) -> AdaptiveTarget:
    mean = geometric_mean(ratios(rows, ADAPTIVE, HYBRID))
    what = "packets against the paper's hybrid, recordings and scenes"
    return AdaptiveTarget(what, f"at most {MOST:g}", band(mean, 3), None if mean is None else mean.mean <= MOST)


def _best(rows: Sequence[RateRow]) -> AdaptiveTarget:
    found = against_best(rows, ADAPTIVE, SINGLES)
    within = sum(one.within for one in found)
    return AdaptiveTarget(
        "packets against the best single predictor of each signal",
        "1.05 (under 10/s: 1/s more) on each",
        f"{within} of {len(found)} signals within",
        within == len(found) if found else None,
    )


def _felt(matches: Sequence[MatchRow]) -> Iterator[AdaptiveTarget]:
    for what, figure in (("RMS error", "error_rms_n"), ("largest step", "largest_step_n")):
        mean = geometric_mean(felt_ratios(matches, ADAPTIVE, figure))
        met = None if mean is None else mean.mean < 1.0
        yield AdaptiveTarget(f"{what} of the force at the hybrid's packets", "below 1", band(mean, 3), met)


def _friction(results: AdaptiveResults) -> Iterator[AdaptiveTarget]:
    for scene, name in FRICTION_AND_MOTION.items():
        found = seed_ratios(results, scene)
        mean = seed_mean(found)
        text = "-" if mean is None else f"{mean:.3f} ({value_range(found)}, {len(found)} seeds)"
        met = None if mean is None else mean <= MOST_WITH_FRICTION
        yield AdaptiveTarget(f"packets against the hybrid, {name}", f"at most {MOST_WITH_FRICTION:g}", text, met)


def _laws(results: AdaptiveResults) -> AdaptiveTarget:
    coded: list[RateRow | MatchRow] = [*results.rates, *results.matches]
    outside = sum(row.outside for row in coded)
    differing, ticks = sum(row.differing for row in results.costs), sum(row.ticks for row in results.costs)
    return AdaptiveTarget(
        "laws: within the deadband, states bit-identical (any-loss recovery: the tests of the codec)",
        "none broken",
        f"{outside} ticks outside in {len(coded)} runs; states differ in {differing} of {ticks} ticks",
        outside == 0 and differing == 0 if coded and ticks else None,
    )


def _cost(results: AdaptiveResults) -> AdaptiveTarget:
    what, asked = "encode plus decode of a tick in CPython", f"median under {MOST_US:g} us"
    found = next((row for row in results.costs if row.variant == ADAPTIVE), None)
    if found is None:
        return AdaptiveTarget(what, asked, "-", None)
    text = f"median {found.median_us:.0f}, mean {found.mean_us:.0f}, p99 {found.p99_us:.0f} us"
    return AdaptiveTarget(what, asked, text, found.median_us < MOST_US)
