"""Where `adaptive` loses, in words made from the rows."""

from collections.abc import Iterator, Sequence

from weberlink.codec.predictors import ADAPTIVE, HYBRID
from weberlink.studies.adaptive.comparison import against_best, ratios
from weberlink.studies.adaptive.rows import Match, Rate
from weberlink.studies.adaptive.variants import ALL_SINGLES, SINGLES
from weberlink.studies.adaptive.verdict import compared

NAMED = 12
"""So many signals at most are named in a sentence."""


def losses(rates: Sequence[Rate], matches: Sequence[Match]) -> Iterator[str]:
    """Sentences as items of a list, for rows of one floor."""
    yield from _more_than_hybrid(rates)
    yield from _beyond_best(rates, SINGLES, "the best of the paper's four predictors")
    yield from _beyond_best(rates, ALL_SINGLES, "the best of all seven single predictors")
    for words, figure in (("RMS error", "error_rms_n"), ("largest step", "largest_step_n")):
        found = compared(matches, ADAPTIVE, figure)
        worse = sorted((one for one in found if one.value > 1.0), key=lambda one: -one.value)
        named = [f"{one.signal} ({one.value:.2f})" for one in worse]
        if found:
            count = f"{len(worse)} of {len(found)} signals"
            yield f"- At the hybrid's packets its {words} is larger on {count}{_listed(named)}."


def _more_than_hybrid(rates: Sequence[Rate]) -> Iterator[str]:
    found = ratios(rates, ADAPTIVE, HYBRID)
    worse = sorted((one for one in found if one.value > 1.0), key=lambda one: -one.value)
    per_s = {(row.signal, row.variant): row.packets_per_s for row in rates}
    named = [
        f"{one.signal} ({per_s[one.signal, ADAPTIVE]:.1f} against {per_s[one.signal, HYBRID]:.1f}/s)" for one in worse
    ]
    yield f"- It sends more than the hybrid on {len(worse)} of {len(found)} signals{_listed(named)}."


def _beyond_best(rates: Sequence[Rate], singles: Sequence[str], words: str) -> Iterator[str]:
    found = against_best(rates, ADAPTIVE, singles)
    if not found:
        return
    beyond = sorted((one for one in found if not one.within), key=lambda one: one.single_per_s - one.per_s)
    named = [f"{one.signal} ({one.per_s:.1f} against {one.single_per_s:.1f}/s of {one.single})" for one in beyond]
    yield (
        f"- Against {words} it breaks the law (1.05 of it; under 10/s, 1/s more) on {len(beyond)} of {len(found)} "
        f"signals{_listed(named)}."
    )


def _listed(named: Sequence[str]) -> str:
    if not named:
        return ""
    more = f" and {len(named) - NAMED} more" if len(named) > NAMED else ""
    return ": " + ", ".join(named[:NAMED]) + more
