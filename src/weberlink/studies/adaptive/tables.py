"""Tables and lists of the page as Markdown; every number comes from a row."""

from collections.abc import Iterable, Iterator, Sequence

from weberlink.codec.predictors import ADAPTIVE, HYBRID
from weberlink.studies.adaptive.comparison import (
    AdaptiveResults,
    CostRow,
    MatchRow,
    RateRow,
    SignalRatio,
    against_best,
    against_best_ratios,
    felt_ratios,
    geometric_mean,
    packet_rates,
    ratios,
)
from weberlink.studies.adaptive.signals import FRICTION_AND_MOTION
from weberlink.studies.adaptive.targets import AdaptiveTarget, band, seed_mean, seed_ratios, value_range
from weberlink.studies.adaptive.variants import ABLATIONS, ALL_SINGLES, FLOOR_N, SINGLES, TUNINGS
from weberlink.studies.adaptive.work import ABLATION, RATES, TUNING

Lines = Iterator[str]

MET = {True: "met", False: "**not met**", None: "not measured"}
FELT = {"error_rms_n": 4, "error_rms_jnd": 2, "largest_step_n": 3, "step_jnd": 2}
"""Figures of a match, with their digits."""
FELT_HEAD = ("RMS [N]", "RMS [JND]", "largest step [N]", "99.9 % step [JND]")
NAMED = 12
"""Most signals that a sentence names."""

PUBLISHED_FLOOR_N = 0.05
PUBLISHED_PER_S = {
    "omega3_1": 54.9,
    "omega3_13": 40.9,
    "omega3_19": 23.3,
    "omega3_7": 31.6,
    "tue_foam_1": 21.0,
    "tue_foam_2": 47.2,
    "tue_free_1": 9.5,
    "tue_free_2": 7.2,
    "tue_rigid_1": 25.2,
    "tue_rigid_2": 27.3,
    "tue_spring_1": 12.2,
    "tue_spring_2": 18.0,
}
"""Packets per second of the paper's hybrid by an independent implementation: k = 0.10, floor 0.05 N, the measured force
as reference, no wire steps. Where a fit is ill-conditioned, the count depends on when a model is trusted."""


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> Lines:
    """A Markdown table after a blank line."""
    yield ""
    yield "| " + " | ".join(head) + " |"
    yield "|---" * len(head) + "|"
    yield from ("| " + " | ".join(row) + " |" for row in rows)


def target_table(found: Sequence[AdaptiveTarget]) -> Lines:
    yield from table(
        ("target", "limit", "measured", ""), ([one.what, one.asked, one.found, MET[one.met]] for one in found)
    )


def summary_table(groups: Sequence[tuple[str, Sequence[RateRow]]]) -> Lines:
    """Geometric means over several sets of rows."""
    head = ("signals", "number", "against hybrid", "against the best of four", "against the best of seven")
    rows = []
    for name, rates in groups:
        if rates:
            found = ratios(rates, ADAPTIVE, HYBRID)
            best = [against_best_ratios(against_best(rates, ADAPTIVE, singles)) for singles in (SINGLES, ALL_SINGLES)]
            rows.append([name, str(len(found)), *(band(geometric_mean(one)) for one in (found, *best))])
    yield from table(head, rows)


def rate_table(rows: Sequence[RateRow], variants: Sequence[str]) -> Lines:
    """Packets per second of every signal, and the ratios of `adaptive` to the hybrid and to the best of four."""
    rates = packet_rates(rows)
    best = {one.signal: one.ratio for one in against_best(rows, ADAPTIVE, SINGLES)}
    yield from table(
        ("signal", *variants, "/ hybrid", "/ best of four"),
        (
            [
                signal,
                *(number(rates.get((signal, variant))) for variant in variants),
                _over_hybrid(rates, signal),
                number(best.get(signal), 2),
            ]
            for signal in signals(rows)
        ),
    )


def published_table(rows: Sequence[RateRow]) -> Lines:
    """The published counts of the hybrid beside ours, where there are any."""
    rates = packet_rates(rows)
    yield from table(
        ("signal", "hybrid, independent", "hybrid", "adaptive", "/ hybrid"),
        (
            [signal, number(PUBLISHED_PER_S[signal]),
             *(number(rates.get((signal, name))) for name in (HYBRID, ADAPTIVE)), _over_hybrid(rates, signal)]
            for signal in signals(rows)
            if signal in PUBLISHED_PER_S
        ),
    )  # fmt: skip


def match_table(matches: Sequence[MatchRow]) -> Lines:
    """The felt force at equal packets: in each cell the hybrid's figure, then that of `adaptive`."""
    found = {(row.signal, row.variant): row for row in matches}
    rows = []
    for signal in signals(matches):
        hybrid, adaptive = (found.get((signal, variant)) for variant in (HYBRID, ADAPTIVE))
        if hybrid is None or adaptive is None:
            continue
        cells = {
            figure: f"{getattr(hybrid, figure):.{digits}f}, {getattr(adaptive, figure):.{digits}f}"
            for figure, digits in {"packets_per_s": 1, **FELT}.items()
        }
        rows.append([signal, cells.pop("packets_per_s"), f"{adaptive.weber:.3f}", *cells.values()])
    yield from table(("signal", "packets/s", "k of adaptive", *FELT_HEAD), rows)


def felt_means(matches: Sequence[MatchRow], variants: Sequence[tuple[str, str]]) -> Lines:
    """Mean ratios at equal packets of variants to references."""
    rows = []
    for variant, reference in variants:
        found = [felt_ratios(matches, variant, figure, reference) for figure in FELT]
        rows.append([variant, reference, str(len(found[0])), *(band(geometric_mean(one)) for one in found)])
    yield from table(("", "against", "signals", *FELT_HEAD), rows)


def ablations(results: AdaptiveResults) -> list[tuple[str, list[SignalRatio]]]:
    """Packets without a part over those of `adaptive`, for each part; the hybrid has none of the parts."""
    whole = results.of(RATES, half="reported", floor_n=FLOOR_N, variant=ADAPTIVE)
    found = [(name, ratios(whole + results.of(ABLATION, variant=name), name, ADAPTIVE)) for name in ABLATIONS]
    hybrid = results.of(RATES, half="reported", floor_n=FLOOR_N, variant=HYBRID)
    return [*found, ("the paper's bank and choice", ratios(whole + hybrid, HYBRID, ADAPTIVE))]


def ablation_table(results: AdaptiveResults) -> Lines:
    yield from table(
        ("", "packets over those of adaptive", "most on", "least on"),
        ([name, band(geometric_mean(found)), *_extremes(found)] for name, found in ablations(results)),
    )


def tuning_table(results: AdaptiveResults) -> Lines:
    """Neighbours of the constants, on the tuning half."""
    whole = results.of(RATES, half="chosen", floor_n=FLOOR_N, variant=ADAPTIVE)
    yield from table(
        ("instead", "packets over those of adaptive"),
        (
            [name, band(geometric_mean(ratios(whole + results.of(TUNING, variant=name), name, ADAPTIVE)))]
            for name in TUNINGS
        ),
    )


def friction_table(results: AdaptiveResults) -> Lines:
    rows = []
    for scene, name in FRICTION_AND_MOTION.items():
        found = seed_ratios(results, scene)
        if found:
            each = ", ".join(f"{one.value:.2f}" for one in found)
            rows.append([name, f"{seed_mean(found):.2f}", value_range(found), each])
    yield from table(("scene", "geometric mean over seeds", "least to largest", "each"), rows)


def limit_table(limits: Sequence[RateRow], rates: Sequence[RateRow]) -> Lines:
    """The clairvoyant bounds beside the packet rates."""
    bounds, real = packet_rates(limits), packet_rates(rates)
    yield from table(
        ("signal", "zoh: limit", "linear: limit", "hybrid: limit", "hybrid", "adaptive"),
        (
            [
                signal,
                *(number(bounds.get((signal, family))) for family in ("zoh", "linear", HYBRID)),
                *(number(real.get((signal, variant))) for variant in (HYBRID, ADAPTIVE)),
            ]
            for signal in signals(limits)
        ),
    )


def cost_table(costs: Sequence[CostRow]) -> Lines:
    yield from table(
        ("", "ticks", "median [us]", "mean [us]", "p99 [us]", "worst [us]"),
        (
            [row.variant, str(row.ticks), f"{row.median_us:.1f}", f"{row.mean_us:.1f}", f"{row.p99_us:.0f}",
             f"{row.worst_us:.0f}"]
            for row in costs
        ),
    )  # fmt: skip


def losses(rates: Sequence[RateRow], matches: Sequence[MatchRow]) -> Lines:
    """List items that say where `adaptive` is worse, for rows of one floor."""
    per_s = packet_rates(rates)
    found = ratios(rates, ADAPTIVE, HYBRID)
    worse = _worse(found)
    named = [
        f"{one.signal} ({per_s[one.signal, ADAPTIVE]:.1f} against {per_s[one.signal, HYBRID]:.1f}/s)" for one in worse
    ]
    yield f"- It sends more than the hybrid on {len(worse)} of {len(found)} signals{_listed(named)}."
    for singles, name in (
        (SINGLES, "the best of the paper's four predictors"),
        (ALL_SINGLES, "the best of all seven single predictors"),
    ):
        best = against_best(rates, ADAPTIVE, singles)
        if best:
            beyond = sorted((one for one in best if not one.within), key=lambda one: one.single_per_s - one.per_s)
            named = [
                f"{one.signal} ({one.per_s:.1f} against {one.single_per_s:.1f}/s of {one.single})" for one in beyond
            ]
            yield (
                f"- Against {name} it exceeds the limit (1.05 of it; under 10/s, 1/s more) on {len(beyond)} of "
                f"{len(best)} signals{_listed(named)}."
            )
    for name, figure in (("RMS error", "error_rms_n"), ("largest step", "largest_step_n")):
        found = felt_ratios(matches, ADAPTIVE, figure)
        worse = _worse(found)
        named = [f"{one.signal} ({one.value:.2f})" for one in worse]
        if found:
            yield (
                f"- At the hybrid's packets its {name} is larger on {len(worse)} of {len(found)} "
                f"signals{_listed(named)}."
            )


def signals(rows: Iterable[RateRow | MatchRow]) -> list[str]:
    """Names in the order of the rows."""
    return list(dict.fromkeys(row.signal for row in rows))


def number(value: float | None, digits: int = 1) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _over_hybrid(rates: dict[tuple[str, str], float], signal: str) -> str:
    mine, hybrid = rates.get((signal, ADAPTIVE)), rates.get((signal, HYBRID))
    return number(mine / hybrid if mine is not None and hybrid else None, 2)


def _extremes(found: Sequence[SignalRatio]) -> list[str]:
    """The signals with the largest and the smallest ratio."""
    if not found:
        return ["-", "-"]
    ends = max(found, key=lambda one: one.value), min(found, key=lambda one: one.value)
    return [f"{one.signal} ({one.value:.2f})" for one in ends]


def _worse(found: Sequence[SignalRatio]) -> list[SignalRatio]:
    return sorted((one for one in found if one.value > 1.0), key=lambda one: -one.value)


def _listed(named: Sequence[str]) -> str:
    if not named:
        return ""
    more = f" and {len(named) - NAMED} more" if len(named) > NAMED else ""
    return ": " + ", ".join(named[:NAMED]) + more
