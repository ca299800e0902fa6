"""What `adaptive` was to show, beside what it shows on the half of the signals that did not choose its parameters."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from weberlink.codec.predictors import ADAPTIVE, HYBRID
from weberlink.studies.adaptive.comparison import Ratio, against_best, geometric_mean, ratios
from weberlink.studies.adaptive.rows import Match, Rate, Results
from weberlink.studies.adaptive.signals import RUBBED_AND_MOVED
from weberlink.studies.adaptive.variants import FLOOR_N, SINGLES
from weberlink.studies.adaptive.work import RATES, UNSEEN
from weberlink.studies.curves import Band

MOST = 0.8
MOST_RUBBED = 0.6
MOST_US = 40.0


@dataclass(frozen=True)
class Target:
    """One line.

    Args:
        what: was asked for.
        asked: the limit.
        found: in words.
        met: None where nothing was measured.
    """

    what: str
    asked: str
    found: str
    met: bool | None


def targets(results: Results) -> list[Target]:
    """All of them, in the order in which they were set."""
    reported = results.of(RATES, half="reported", floor_n=FLOOR_N)
    return [
        _packets(reported),
        _best(reported),
        *_felt(results.matches),
        *_rubbed(results),
        _laws(results),
        _cost(results),
    ]


def compared(
    matches: Iterable[Match], variant: str, figure: str, reference: str = HYBRID, signals: Iterable[str] | None = None
) -> list[Ratio]:
    """A figure of one codec over that of another at equal packets, for every signal that has both."""
    listed, wanted = list(matches), None if signals is None else set(signals)
    under = {row.signal: getattr(row, figure) for row in listed if row.variant == reference}
    return [
        Ratio(row.signal, row.group, getattr(row, figure) / under[row.signal])
        for row in listed
        if row.variant == variant
        and (wanted is None or row.signal in wanted)
        and under.get(row.signal, 0.0) > 0.0
        and getattr(row, figure) > 0.0
    ]


def rubbed(results: Results, scene: str) -> list[Ratio]:
    """Packets of `adaptive` over those of the hybrid in a scene, by seed; the one that chose is left out."""
    first = results.of(RATES, half="reported", floor_n=FLOOR_N, group=scene)
    return ratios(first + results.of(UNSEEN, group=scene), ADAPTIVE, HYBRID)


def band(found: Band | None, digits: int = 2) -> str:
    """In words."""
    if found is None:
        return "-"
    return f"{found.mean:.{digits}f} ({found.low:.{digits}f} to {found.high:.{digits}f})"


def _packets(rows: Sequence[Rate]) -> Target:
    mean = geometric_mean(ratios(rows, ADAPTIVE, HYBRID))
    what = "packets against the paper's hybrid, recordings and scenes"
    return Target(what, f"at most {MOST:g}", band(mean, 3), None if mean is None else mean.mean <= MOST)


def _best(rows: Sequence[Rate]) -> Target:
    found = against_best(rows, ADAPTIVE, SINGLES)
    beyond = [one for one in found if not one.within]
    words = f"{len(found) - len(beyond)} of {len(found)} signals within"
    what = "packets against the best single predictor of each signal"
    asked = "1.05 (under 10/s: 1/s more) on each"
    return Target(what, asked, words, not beyond if found else None)


def _felt(matches: Sequence[Match]) -> Iterator[Target]:
    for what, figure in (("RMS error", "error_rms_n"), ("largest step", "largest_step_n")):
        mean = geometric_mean(compared(matches, ADAPTIVE, figure))
        met = None if mean is None else mean.mean < 1.0
        yield Target(f"{what} of the force at the hybrid's packets", "below 1", band(mean, 3), met)


def _rubbed(results: Results) -> Iterator[Target]:
    for scene in RUBBED_AND_MOVED:
        found = rubbed(results, scene)
        mean = overall(found)
        words = "-" if mean is None else f"{mean:.3f} ({spread(found)}, {len(found)} seeds)"
        what = f"packets against the hybrid, {NAMES[scene]}"
        yield Target(what, f"at most {MOST_RUBBED:g}", words, None if mean is None else mean <= MOST_RUBBED)


NAMES = {
    "plane_friction": "plane with friction 0.3",
    "sphere_friction": "sphere with friction 0.3",
    "plane_moving": "plane moving at up to 0.1 m/s, 1 Hz",
}


def overall(found: Sequence[Ratio]) -> float | None:
    """Geometric mean over seeds of one scene, each by itself."""
    mean = geometric_mean([Ratio(one.signal, one.signal, one.value) for one in found])
    return None if mean is None else mean.mean


def spread(found: Sequence[Ratio]) -> str:
    """The least and the largest."""
    values = [one.value for one in found]
    return f"{min(values):.2f} to {max(values):.2f}"


def _laws(results: Results) -> Target:
    runs = len(results.rates) + len(results.matches)
    outside = sum(row.outside for row in results.rates) + sum(row.outside for row in results.matches)
    differing, ticks = sum(row.differing for row in results.costs), sum(row.ticks for row in results.costs)
    words = f"{outside} ticks outside in {runs} runs; states differ in {differing} of {ticks} ticks"
    what = "laws: within the deadband, states bit-identical (any-loss recovery: the tests of the codec)"
    return Target(what, "none broken", words, outside == 0 and differing == 0 if runs and ticks else None)


def _cost(results: Results) -> Target:
    found = next((row for row in results.costs if row.variant == ADAPTIVE), None)
    words = (
        "-" if found is None else f"median {found.median_us:.0f}, mean {found.mean_us:.0f}, p99 {found.p99_us:.0f} us"
    )
    met = None if found is None else found.median_us < MOST_US
    return Target("encode plus decode of a tick in CPython", f"median under {MOST_US:g} us", words, met)
