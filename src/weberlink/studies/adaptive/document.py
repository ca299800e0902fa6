"""The page of the study as Markdown; every number comes from a row."""

from collections.abc import Iterable, Iterator, Sequence
from textwrap import wrap

from weberlink.codec.predictors import ADAPTIVE_BANK
from weberlink.studies import recordings
from weberlink.studies.adaptive.coding import COMPARED, FLOOR_N, SINGLES, WEBER, RateRow
from weberlink.studies.adaptive.comparison import GroupFigures, SignalRatios, by_group, over_sources, ratios, run_times
from weberlink.studies.adaptive.signals import BASE_HZ, SYNTHETIC, AdaptiveScope
from weberlink.studies.curves import Band
from weberlink.studies.evaluate.by_source import MORE_PER_S, MOST

TITLE = "The adaptive predictor"
NAMED = 8
"""Most losses that are named."""
WIDTH = 118

CHOSEN_BY = (
    "Which data chose the constants: those of `path`, `elastic` and `adaptive` (`codec/predictors/learning.py`, "
    "`codec/predictors/path.py`, `codec/adaptive.py`) were chosen with the recordings `tue` and `omega3`; those of "
    "`surface` and `affine` with recordings of the same two sources and with seed 1 of the still, rubbing and moving "
    "scenes, which share the model of contact of `surface`. No constant was chosen with `ochoa_polish`, "
    "`panda_comanip` or `stroke_iiwa_teleop`, which are test data, nor with the synthetic signals or the scenes of "
    "texture. The order of the bank was chosen with seed 1 of `plane`, `sphere_cavity`, `box`, `soft_plane`, "
    "`plane_changing`, `sphere_changing` and `plane_velocity_friction`, and with `tue_spring_2`."
)


def document(rows: Sequence[RateRow], scope: AdaptiveScope, caption: str, *, drawn: bool) -> str:
    """The page.

    Args:
        rows: of all signals, rates and predictors.
        scope: of the study.
        caption: machine, versions and commit.
        drawn: whether the figure is beside the page.
    """
    return "\n".join(_lines(rows, scope, caption, drawn=drawn)) + "\n"


def summary(rows: Sequence[RateRow], rate_hz: int) -> list[GroupFigures]:
    """The groups at one rate, and the sources of recordings together, each counting once: all, and the test data."""
    found = ratios(rows)
    groups = [one for one in by_group(found) if one.rate_hz == rate_hz]
    sources = list(dict.fromkeys(one.source for one in found if one.kind == "recording"))
    tests = [name for name in sources if name in recordings.SOURCES and recordings.SOURCES[name].chose == "none"]
    together = [(f"all {len(sources)} sources", sources), (f"the {len(tests)} sources of test data", tests)]
    extra = [over_sources(found, name, rate_hz, which) for name, which in together if len(which) > 1]
    return groups + [one for one in extra if one is not None]


def _lines(rows: Sequence[RateRow], scope: AdaptiveScope, caption: str, *, drawn: bool) -> Iterator[str]:
    found = ratios(rows)
    base = BASE_HZ if BASE_HZ in scope.rates_hz else scope.rates_hz[0]
    yield f"# {TITLE}"
    yield from paragraph(
        f"`adaptive` (bank {', '.join(ADAPTIVE_BANK)}) against the paper's `hybrid` and against the best of its single "
        f"predictors ({', '.join(SINGLES)}) on each signal, at k = {WEBER:g}, floor {FLOOR_N:g} N, quantised as on the "
        f"wire, without loss or delay. Made by `weberlink study adaptive --docs docs/adaptive` in "
        f"{sum(row.processor_s for row in rows):.0f} s of one core; the rows are in [adaptive.json](adaptive.json)."
    )
    if drawn:
        yield ""
        yield "![Packets of adaptive over those of the hybrid and of the best single predictor](packets.png)"
    for rate in (base, *(rate for rate in scope.rates_hz if rate != base)):
        yield from _rate(summary(rows, rate), rate, scope)
    yield from paragraph(
        "Geometric means over the signals of a group, with 95 % bootstrap intervals over signals (of two signals the "
        "interval is their range). *bytes*: UDP payload over that of the hybrid; *error*: RMS error in JND over that "
        f"of the hybrid, at the same deadband; *above*: signals with more than {MOST:g} of the best single predictor; "
        f"*lost*: those that also send more than {MORE_PER_S:g} packet per second more. Over several sources each "
        "source counts once."
    )
    yield from _provenance(scope)
    yield from _losses(found, scope)
    yield from _synthetic(found, scope.rates_hz)
    yield from _checks(rows, base)
    yield ""
    yield "---"
    yield caption


def _rate(groups: Sequence[GroupFigures], rate_hz: int, scope: AdaptiveScope) -> Iterator[str]:
    yield ""
    yield f"## {rate_hz} Hz"
    if rate_hz > BASE_HZ:
        recorded, seeds = scope.fast_signals
        yield from paragraph(
            f"At most {scope.fast_s:g} s from the middle of each signal, {recorded} recordings of each group and "
            f"{seeds} seed of each scene."
        )
    head = ("", "signals", "packets/s", "over hybrid", "bytes", "error", "over best", "worst", "above", "lost")
    yield from table(head, map(_cells, groups))


def _cells(one: GroupFigures) -> tuple[str, ...]:
    return (
        one.name,
        str(one.signals),
        f"{one.per_s:.1f}",
        band(one.over_hybrid),
        f"{one.bytes_over_hybrid:.2f}",
        f"{one.error_over_hybrid:.2f}",
        band(one.over_best),
        f"{one.worst[0]:.2f} {one.worst[1]}",
        f"{100 * one.above:.0f} %",
        f"{100 * one.lost:.0f} %",
    )


def _provenance(scope: AdaptiveScope) -> Iterator[str]:
    yield ""
    yield "## Signals and what they chose"
    yield from paragraph(
        "Recordings are those of the package ([evaluate](../evaluate.md#shipped-recordings)), scenes and synthetic "
        "signals those of [scenes](../scenes.md#signals-of-scenes), with sensor noise of 2 mN where nothing else is "
        "said. At another rate than their own, recordings and scenes are interpolated, and noise is drawn for every "
        f"sample. Seeds of the scenes: {', '.join(map(str, scope.seeds))}; of the synthetic signals: 1."
    )
    yield from paragraph(CHOSEN_BY)


def _losses(found: Sequence[SignalRatios], scope: AdaptiveScope) -> Iterator[str]:
    yield ""
    yield "## Where it loses"
    yield ""
    for rate in scope.rates_hz:
        at = [one for one in found if one.rate_hz == rate]
        lost = sorted((one for one in at if one.lost), key=lambda one: -one.over_best)
        behind = sum(one.over_hybrid > 1.0 for one in at)
        named = [f"{one.signal} ({one.per_s:.1f} against {one.best_per_s:.1f}/s of {one.best})" for one in lost[:NAMED]]
        if len(lost) > NAMED:
            named.append(f"and {len(lost) - NAMED} more")
        yield f"- {rate} Hz: more packets than the hybrid on {behind} of {len(at)} signals;"
        yield f"  lost to the best single predictor on {len(lost)}{': ' if named else ''}{'; '.join(named)}."


def _synthetic(found: Sequence[SignalRatios], rates: Sequence[int]) -> Iterator[str]:
    names = dict.fromkeys(one.signal for one in found if one.group == SYNTHETIC)
    if not names:
        return
    at = {(one.signal, one.rate_hz): one for one in found}
    yield ""
    yield "## Synthetic signals"
    yield ""
    yield "Packets of `adaptive` over the hybrid, and over the best single predictor."
    cells = (
        (name, *(f"{at[name, rate].over_hybrid:.2f}, {at[name, rate].over_best:.2f}" for rate in rates))
        for name in names
    )
    yield from table(("", *(f"{rate} Hz" for rate in rates)), cells)


def _checks(rows: Sequence[RateRow], base: int) -> Iterator[str]:
    broken = [row for row in rows if row.outside]
    yield ""
    yield "## Deadband and run time"
    yield ""
    if broken:
        first = f"the first {broken[0].signal} with {broken[0].predictor} at {broken[0].rate_hz} Hz"
        yield f"**Ticks outside their deadband in {len(broken)} of {len(rows)} runs**, {first}."
    else:
        yield f"No tick of {len(rows)} runs was outside its deadband."
    times = run_times(rows, base)
    told = ", ".join(f"{name} {times[name]:.0f} us" for name in COMPARED)
    yield f"Median run time of encode plus decode at {base} Hz, while other signals were coded beside: {told}."


def paragraph(text: str) -> Iterator[str]:
    """Lines of a paragraph after a blank line."""
    yield ""
    yield from wrap(text, WIDTH, break_long_words=False, break_on_hyphens=False)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """A Markdown table after a blank line."""
    yield ""
    yield "| " + " | ".join(head) + " |"
    yield "|---" * len(head) + "|"
    yield from ("| " + " | ".join(row) + " |" for row in rows)


def band(one: Band) -> str:
    return f"{one.mean:.2f} ({one.low:.2f} to {one.high:.2f})"
